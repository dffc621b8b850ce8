"""Grass as a bidirectional texture function: a tile of real blades, rendered once for all directions of view and light.

`blades` makes the tile, `generate` has Cycles render it, `compression` makes few numbers of the pictures, and `patch`
is the file of them. `directions` says between which pictures a direction lies. Method and source: docs/grass.md.
"""
