"""Typed configuration: a frozen model per folder of `configs/`.

| files | model | a new field goes into |
|---|---|---|
| `configs/sensor/*.yaml` | `SensorConfig`: the imager | `sensor.py` |
| `configs/laser/*.yaml` | `LaserConfig`: the light source | `laser.py` |
| `configs/bank/*.yaml` | `BankConfig`, with `camera` and `world`: what is rendered | `bank.py` |
| `configs/env/*.yaml` | `EnvConfig`, with `reward`: the decision problem | `env.py` |

A field is one line in its model: name, type with its bounds, default, description. From there it is
a key in YAML files, a keyword of `env_config` and of `gym.make`, an option of the command line
(`--env.laser.trip_k 340`), and a line in `--help`. Numbers are in SI units (but `_nm`, `_deg` and
`_ev`), and the name ends in the unit: `_m _s _hz _w _j _k _e _lsb`. A field of the sensor counts as
baked into banks until `ACQUISITION_FIELDS` names it; see there.

A section within another, such as the sensor of an environment, is given as

- a name: `sensor="epc660"` is `configs/sensor/epc660.yaml`;
- the path of a YAML file: `sensor="my/imager.yaml"`; within a YAML file, relative to that file;
- a mapping of the values that change: `sensor={"min_snr": 3.0}` keeps the others.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
