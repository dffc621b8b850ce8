"""Candela, a render engine for Blender: real-time global illumination, held against Cycles."""
