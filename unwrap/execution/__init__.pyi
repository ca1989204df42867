from .cores import available_cores as available_cores
from .places import output_to as output_to, visible as visible, wait_for_file as wait_for_file
from .tasks import check_execution as check_execution, run_tasks as run_tasks
from .work import Executor as Executor, WorkerError as WorkerError
