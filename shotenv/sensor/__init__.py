"""Light becomes electrons, noise and converter words."""
