"""The loop and its referee: episodes are driven, judged, traced and filmed."""
