from .cores import available_cores as available_cores
from .places import is_seen as is_seen, output_to as output_to, visible as visible
from .tasks import check_execution as check_execution, run_tasks as run_tasks
from .work import Executor as Executor, WorkerError as WorkerError
