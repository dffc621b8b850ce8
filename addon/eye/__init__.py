"""A human eye as numbers: the obstacles in its pupil over time, and how they scatter light.

Pure numpy. Lengths are millimetres in the plane of the pupil, x to the right, y up, z along the optical axis; times are
seconds. Everything is a closed form of time, so that any frame can be had without those before it.
"""
