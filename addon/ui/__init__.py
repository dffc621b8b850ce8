"""What the artist touches: properties, panels, operators."""
