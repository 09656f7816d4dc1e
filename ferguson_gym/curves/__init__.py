"""Ferguson segments: points, derivatives, arc length, curvature, certified clearance, and chains."""
