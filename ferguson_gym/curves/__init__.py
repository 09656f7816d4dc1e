"""Ferguson segments: derivatives, arc length, curvature, certified clearance, and chains."""
