"""Performance as ratios, both sides measured alternately in one run. `make bench` runs them all."""
