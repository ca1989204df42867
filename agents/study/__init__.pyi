from .job_runs import run_jobs as run_jobs
from .jobs import Job as Job, jobs_of as jobs_of
from .leaderboard import make_leaderboard as make_leaderboard
from .published_jobs import publish_study as publish_study
from .seeds import train_seeds as train_seeds
