from .cores import available_cores as available_cores
from .places import stderr_to as stderr_to, visible as visible
from .tasks import run_tasks as run_tasks
from .work import Executor as Executor, WorkerError as WorkerError
