"""Commands that render banks, tell what is in them and check them."""

from __future__ import annotations

import io
from pathlib import Path

from jsonargparse import ArgumentParser, Namespace
from jsonargparse.typing import NonNegativeInt, PositiveFloat, PositiveInt

from agents.cli.command import (
    DONE,
    FAILED,
    Command,
    add_config,
    add_executor,
    add_json,
    add_place,
    execution_of,
    section_of,
    write_numbers,
)
from shotenv.config import BankConfig, ConfigError, find_config
from unwrap.support import progress, say, write_bytes


def render_arguments(parser: ArgumentParser) -> None:
    """What is rendered, where to, and where it is computed."""
    add_config(parser, BankConfig, "bank/starter.yaml")
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder of the bank")
    add_place(parser, "a place in its stead, such as s3://bucket/bank")
    parser.add_argument(
        "--scene", type=Path, metavar="FILE", help="render this scene (XML, PLY, OBJ, STL, GLB)"
    )
    parser.add_argument("--path", type=Path, metavar="FILE", help="ways through it, lights (YAML)")
    parser.add_argument("--materials", type=Path, metavar="FILE", help="its surfaces (YAML)")
    add_executor(parser, "clips")


def render_bank(arguments: Namespace) -> int:
    """Render a bank, of drawn worlds or of a scene of one's own."""
    # Here and below imports stand inside the commands: `shotenv --help` is to answer at once, and
    # torch alone takes seconds to load.
    from shotenv.bank import build_bank, build_published

    config = section_of(BankConfig, arguments)
    scene, way, materials = arguments.scene, arguments.path, arguments.materials
    if scene is not None and way is not None:
        from shotenv.scenes import own_bank

        config = own_bank(config, scene, way, materials)
    elif any(given is not None for given in (scene, way, materials)):
        raise ConfigError("--scene, --path and --materials: expected the first two, or none")
    if arguments.to is not None:
        if arguments.out is not None:
            raise ConfigError("--out and --to: expected one of them, or none")
        build_published(config, arguments.to, **execution_of(arguments))
        print(f"The bank is at {arguments.to}")
        return DONE
    folder = build_bank(config, arguments.out, **execution_of(arguments))
    print(f"The bank is in {folder}")
    return DONE


def info_arguments(parser: ArgumentParser) -> None:
    """Which bank, and the contact sheet that is wanted of it."""
    parser.add_argument("bank", nargs="?", help="name, path or URL of a bank; all that are known")
    parser.add_argument("--sheet", type=Path, metavar="FILE", help="write a contact sheet (PNG)")
    parser.add_argument("--clips", type=PositiveInt, default=3, help="on the sheet, per family")
    add_json(parser)


def tell_about_banks(arguments: Namespace) -> int:
    """Tell what is in a bank, or which banks there are."""
    from shotenv.bank import open_bank
    from shotenv.bank.listing import (
        contact_sheet,
        contents_at,
        contents_of,
        known_banks,
        print_banks,
        print_contents,
    )
    from unwrap.storage import is_url

    if arguments.bank is None:
        banks = known_banks()
        print_banks(banks)
        write_numbers(arguments, banks)
        return DONE
    if is_url(arguments.bank) and arguments.sheet is None:
        about = contents_at(arguments.bank)
    else:
        # Whoever asks what a bank holds does not want to wait an hour for it to be rendered.
        bank = open_bank(arguments.bank, render=False)
        about = contents_of(bank)
    print_contents(about)
    if arguments.sheet is not None:
        content = io.BytesIO()
        contact_sheet(bank, clips=arguments.clips).save(content, format="PNG")
        write_bytes(arguments.sheet, content.getvalue())
        print(f"Contact sheet: {arguments.sheet.resolve()}")
    write_numbers(arguments, about)
    return DONE


def verify_arguments(parser: ArgumentParser) -> None:
    """Which bank."""
    parser.add_argument("bank", help="name, path or URL of a bank")
    add_json(parser)


def verify_bank(arguments: Namespace) -> int:
    """Check every file of a bank against its checksum, at a URL where it lies there."""
    from shotenv.bank import cure_for, open_bank, verify
    from unwrap.storage import is_url

    if is_url(arguments.bank):
        return _verify_published(arguments)
    bank = open_bank(arguments.bank, render=False)
    with progress(len(bank.clips), "verifying", "clip") as bar:
        damaged = verify(bank.folder, tick=bar.update)
    for path in (bank.folder / name for name in damaged):
        say(f"shotenv: {path} is damaged; {cure_for(path)}")
    if not damaged:
        print(f"{bank.folder}: every file is as it was written")
    write_numbers(arguments, {"folder": str(bank.folder), "damaged": list(damaged)})
    return FAILED if damaged else DONE


def _verify_published(arguments: Namespace) -> int:
    from shotenv.bank import verify_published

    url = arguments.bank
    damaged = verify_published(url)
    for file in damaged:
        where = f"{url}/{file.object_name} ({file.path})"
        say(f"shotenv: {where} is missing or damaged; delete it and publish the bank again")
    if not damaged:
        print(f"{url}: every file is as it was published")
    write_numbers(arguments, {"folder": url, "damaged": [file.path for file in damaged]})
    return FAILED if damaged else DONE


def publish_arguments(parser: ArgumentParser) -> None:
    """Which bank, and where to."""
    parser.add_argument("bank", help="name or path of a bank that stands")
    add_place(parser, "place, such as s3://bucket/bank", required=True)


def publish(arguments: Namespace) -> int:
    """Publish a bank that stands."""
    from shotenv.bank import open_bank, publish_bank

    published = publish_bank(open_bank(arguments.bank, render=False), arguments.to)
    print(f"{published.label} is at {arguments.to}: {published.total_bytes / 1e9:.2f} GB")
    return DONE


def thin_arguments(parser: ArgumentParser) -> None:
    """Which bank, how few of its pixels, and where to."""
    parser.add_argument("bank", help="name or path of a rendered bank")
    parser.add_argument(
        "--every", type=PositiveInt, default=8, help="a pixel of each so many squared"
    )
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder to write")
    parser.add_argument("--name", help="of the thinned bank; the folder's by default")
    parser.add_argument("--seed", type=NonNegativeInt, default=0, help="of the positions")
    parser.add_argument(
        "--networks",
        nargs="+",
        default=["tofregnet", "tofsegnet"],
        help="names or files of gray networks whose predictions are kept",
    )
    add_json(parser)


def write_thinned_bank(arguments: Namespace) -> int:
    """Make a thinned bank of a rendered one."""
    from shotenv.bank import open_bank
    from shotenv.bank.listing import contents_of, print_contents
    from shotenv.dataset import thin_bank

    bank = open_bank(arguments.bank)
    with progress(len(bank), "thinning", "frame") as bar:
        thinned = thin_bank(
            bank,
            arguments.out,
            every=arguments.every,
            name=arguments.name,
            seed=arguments.seed,
            networks=arguments.networks,
            tick=bar.update,
        )
    about = contents_of(thinned)
    print_contents(about)
    write_numbers(arguments, about)
    return DONE


def import_arguments(parser: ArgumentParser) -> None:
    """Which recordings of which camera, and where to."""
    parser.add_argument("folder", type=Path, help="folder of recordings, and recordings.yaml")
    parser.add_argument("--camera", required=True, help="name or path of a camera's description")
    parser.add_argument("--sensor", default="epc660", help="name or path of a sensor configuration")
    parser.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder to write")
    parser.add_argument(
        "--truth",
        choices=["external", "own", "none"],
        help="what distances are scored against: references that recordings.yaml names, the depth "
        "of the eight samples, or nothing; the first that can be had",
    )
    add_json(parser)


def import_recordings(arguments: Namespace) -> int:
    """Make a bank of a camera's recordings."""
    from agents.cli.cameras import read_camera
    from shotenv.bank.listing import contents_of, print_contents
    from shotenv.recorded import import_bank

    camera, _ = read_camera(arguments.camera)
    bank = import_bank(
        arguments.folder,
        camera,
        find_config("sensor", arguments.sensor),
        arguments.out,
        truth=arguments.truth,
    )
    about = contents_of(bank)
    print_contents(about)
    print(f"{bank.folder / 'env.yaml'}: an environment that plays it")
    write_numbers(arguments, about)
    return DONE


def light_arguments(parser: ArgumentParser) -> None:
    """Which bank and split, by which laser, and the network that reads its gray images."""
    parser.add_argument("bank", nargs="?", default="starter", help="name or path of a bank")
    parser.add_argument("--split", default="test", help="train, validation, test, all or shift")
    parser.add_argument("--network", default="tofregnet", help="name or file of a gray network")
    parser.add_argument("--laser_power_w", type=PositiveFloat, default=6.3, help="W while on")
    parser.add_argument("--integration_s", type=PositiveFloat, default=6.4e-4, help="of a sample")
    add_json(parser)


def measure_light(arguments: Namespace) -> int:
    """Tell what the light of a bank brings its sensor."""
    from shotenv.bank import keep_predictions, open_bank
    from shotenv.dataset import light_statistics, print_light
    from unwrap.networks import load_unwrapper

    bank = open_bank(arguments.bank)
    if bank.config is None:
        raise ValueError(f"{bank.folder} does not say what sensor it was made for")
    kept = keep_predictions(bank, load_unwrapper(arguments.network))
    clips = bank.splits(arguments.split)
    with progress(sum(clip.frames for clip in clips), "measuring light", "frame") as bar:
        found = light_statistics(
            bank,
            arguments.split,
            bank.config.sensor,
            laser_power_w=arguments.laser_power_w,
            integration_s=arguments.integration_s,
            kept=kept,
            tick=bar.update,
        )
    print_light(found)
    write_numbers(arguments, found)
    return DONE


COMMANDS = (
    Command(
        "render",
        "render a bank of worlds; continues where it stopped",
        render_arguments,
        render_bank,
        resumes=True,
    ),
    Command(
        "bank import",
        "make a bank of a camera's recordings",
        import_arguments,
        import_recordings,
    ),
    Command(
        "bank info",
        "list the banks, or tell and show what is in one",
        info_arguments,
        tell_about_banks,
    ),
    Command(
        "bank light",
        "signal, saturation and gray of a bank, and how long gray errors last",
        light_arguments,
        measure_light,
    ),
    Command(
        "bank publish",
        "put a bank on a place (a bucket, a shared disk), from where it is opened by URL",
        publish_arguments,
        publish,
        resumes=True,
    ),
    Command(
        "bank thin",
        "keep a pixel of each few, and what networks make of the full frames",
        thin_arguments,
        write_thinned_bank,
    ),
    Command(
        "bank verify",
        "check every file of a bank against its checksum",
        verify_arguments,
        verify_bank,
    ),
)
