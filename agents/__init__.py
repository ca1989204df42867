"""Who chooses the shots: policies, training, evaluation, statistics, report, command line."""
