"""Published methods of phase unwrapping and depth from time of flight, to compare with.

Each module names its paper and says what is adapted to one modulation frequency, few samples and
the compute of the project's own networks.
"""
