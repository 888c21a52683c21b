"""Tuning the controller: by hand in a page with live signals, by Ziegler and Nichols, or by a search."""
