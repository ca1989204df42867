"""From raw samples of an indirect time-of-flight sensor to depth. Pure torch; usable alone."""
