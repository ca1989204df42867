from .config import TrainConfig as TrainConfig
from .data import (
    Source as Source,
    acquiring_threads as acquiring_threads,
    in_order as in_order,
    loader as loader,
    training_device as training_device,
)
from .launch import is_first_process as is_first_process
from .loop import train as train
from .measuring import JUDGED_DRAW as JUDGED_DRAW
from .splits import RANDOM_SPLITS as RANDOM_SPLITS, random_split as random_split
