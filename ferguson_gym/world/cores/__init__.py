"""What obstacles need of their convex cores: hulls of points, and distances of points from them."""
