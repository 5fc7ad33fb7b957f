"""What a bus says right now, for people and for logs: the listening detector beside the ECU's own words."""
