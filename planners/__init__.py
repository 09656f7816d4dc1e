"""Planners: field and state in, certified plan out. None knows another, none knows gymnasium."""
