"""Time against error, beside the engines that Blender brings along. Not part of the extension."""
