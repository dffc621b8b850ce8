"""A living human eye as numbers: what stands in the way of light in its pupil at any time, and what becomes of light.

Pure numpy. Lengths are millimetres in the plane of the pupil, x to the right, y up, z along the optical axis; times are
seconds. Everything is a closed form of time, so that any frame can be had without those before it.
"""
