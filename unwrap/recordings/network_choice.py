"""Networks at the frequency that they were trained for, and what of them serves at another."""

from __future__ import annotations

from unwrap.networks import Prediction, Unwrapper, trained_size
from unwrap.signal import Sensed, SensorDescription, unambiguous_range_m


def frequency_warning(
    unwrapper: Unwrapper, sensor: SensorDescription, size: tuple[int, int]
) -> str | None:
    """What is to be said of a network at the sensor's first frequency; None at its own.

    Parameters
    ----------
    size : (int, int)
        Rows and columns of the frames.

    Raises
    ------
    ValueError
        It was trained for another frequency, and looks at samples or at frames of another size:
        what it says there is worth nothing.
    """
    trained_hz = unwrapper.metadata["f1_hz"]
    if trained_hz == sensor.f1_hz:
        return None
    told = f"{unwrapper.name} was trained at {trained_hz / 1e6:g} MHz, not {sensor.f1_hz / 1e6:g}"
    cure = (
        "; expected --unwrapper none, for the wrapped distance, or a network of `shotenv unwrap "
        "train`"
    )
    if unwrapper.network.needs != "gray":
        raise ValueError(f"{told}, and it looks at the samples{cure}")
    height, width = trained_size(unwrapper.metadata)
    if size[0] % height or size[1] % width or size[0] // height != size[1] // width:
        raise ValueError(
            f"{told}, and for {width} x {height} pixels, of which {size[1]} x {size[0]} are no "
            f"multiple{cure}"
        )
    return (
        f"{told} MHz: the distance that it reads from the gray image tells the wrap all the same, "
        f"but now to {unambiguous_range_m(sensor.f1_hz):.2f} m and not to "
        f"{unwrapper.unambiguous_m:.2f} m; an error of half of that is a wrong wrap"
    )


def predict_distance(unwrapper: Unwrapper, sensed: Sensed, sensor: SensorDescription) -> Prediction:
    """What the network says of frames; at a frequency of its own, or as `frequency_warning` says.

    Raises
    ------
    ValueError
        What `frequency_warning` and `Unwrapper.predict_sensed` refuse.
    """
    size = (sensed.gray.shape[-2], sensed.gray.shape[-1])
    if frequency_warning(unwrapper, sensor, size) is None:
        return unwrapper.predict_sensed(sensed, sensor)
    return unwrapper.predict(sensed.gray)
