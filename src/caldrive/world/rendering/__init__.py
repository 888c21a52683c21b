"""How a town is drawn, on the graphics side."""
