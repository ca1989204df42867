"""Performance as ratios, both sides measured alternately in one run. `make bench` runs them all.

- `stepping`: a step of the environment, and of a vector of them, over the least it could do:
  drawing its normal numbers, and one atan2 over its pixels;
- `playing`: frames that a vector of drives plays in a second: of a thinned bank, over every pixel;
  of many drives, over some; of one process, over one for each core; and of PPO, over its
  environment;
- `sensing`: an 8-DCS frame sensed and decoded, over drawing its normal numbers;
- `unwrapping`: the kernel-density vote of an 8-DCS frame, over its form of array operations;
- `rendering`: a rendered frame over Mitsuba's own path integrator with as many rays;
- `networks`: arithmetic of inference and training as a share of a large matrix product's, and what
  the public face of a network costs beside it;
- `scaling`: clips rendered by Ray over processes of this machine; two workers over twice one; and
  milliseconds that a task without work takes;
- `together`: training on two processes of one thread over one of two threads.

A ratio says what the code makes of a machine, and hardly depends on which. As tests do, benchmarks
import by file what is behind a door because no other room may use it (the writer of a bank, the
bare engine of a network), and all else through the doors.
"""
