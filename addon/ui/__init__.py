"""What the artist touches: properties, panels, operators."""

ENGINE = "CANDELA"  # the engine's name in files and scripts
