"""Our solver of windows: elastic sequential quadratic programming with exact Hessians."""
