"""A Gymnasium environment of an indirect time-of-flight sensor that pays for every sample."""
