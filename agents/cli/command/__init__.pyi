from .command import (
    DONE as DONE,
    FAILED as FAILED,
    INTERRUPTED as INTERRUPTED,
    WRONG_USAGE as WRONG_USAGE,
    Command as Command,
    add_config as add_config,
    add_executor as add_executor,
    add_json as add_json,
    add_out as add_out,
    add_out_or_url as add_out_or_url,
    add_place as add_place,
    add_sensor_and_merge as add_sensor_and_merge,
    add_trust as add_trust,
    execution_of as execution_of,
    section_of as section_of,
    write_numbers as write_numbers,
)
from .experiment import (
    add_experiment as add_experiment,
    experiment_of as experiment_of,
    play_on_one_thread as play_on_one_thread,
    prepare_bank as prepare_bank,
)
from .outputs import check_outputs as check_outputs
