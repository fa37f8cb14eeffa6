"""Fringe projection profilometry, from a fringe to a point cloud."""
