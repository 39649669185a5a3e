"""Reading a large bag: time against the bare library's own iteration, and memory.

`python -m benchmarks.log_reading [MEGABYTES]` writes a ROS 1 bag, a ROS 2 bag and an MCAP file
(blobs of 100 kB at 10 Hz beside IMU, odometry and fixes at 100 Hz) and prints one row a file: the
bare library iterating and deserialising the three small topics; listing all streams; and listing
them, then all samples of the three topics as columns.  Processor time of processes of their own,
the best of three.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

TOPICS = ("/fix", "/imu", "/odom")
BARE = """
import sys; from pathlib import Path
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
with AnyReader([Path(sys.argv[1])], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as r:
    wanted = [c for c in r.connections if c.topic in {topics}]
    for c, _, raw in r.messages(connections=wanted): r.deserialize(raw, c.msgtype)
"""
BARE_MCAP = """
import sys
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
with open(sys.argv[1], "rb") as f:
    reader = make_reader(f, decoder_factories=[DecoderFactory()])
    for _ in reader.iter_decoded_messages(topics={topics}): pass
"""
LISTED = """
import sys; from pathlib import Path
from syncline_design.logs.readers import open_recording
print(len(open_recording(Path(sys.argv[1])).streams()))
"""
ALL_OF_IT = """
import sys; from pathlib import Path
from syncline_design.logs.readers import open_recording
recording = open_recording(Path(sys.argv[1]))
recording.streams()
for topic, piece in recording.together({topics}): pass
"""


def main() -> None:
    megabytes = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    with tempfile.TemporaryDirectory() as folder:
        print("| file | MB | bare library [s] | streams [s] | with samples [s] | ratio | MB held |")
        print("|---|---|---|---|---|---|---|")
        for name, path in _written(Path(folder), megabytes):
            size = sum(p.stat().st_size for p in ([path] if path.is_file() else path.iterdir()))
            bare = BARE_MCAP if name == "MCAP" else BARE
            base, _ = _timed(bare.replace("{topics}", repr(TOPICS)), path)
            listed, _ = _timed(LISTED, path)
            whole, held = _timed(ALL_OF_IT.replace("{topics}", repr(TOPICS)), path)
            print(f"| {name} | {size / 1e6:.0f} | {base:.1f} | {listed:.1f} | {whole:.1f} | "
                  f"{whole / base:.2f} | {held:.0f} |", flush=True)  # fmt: skip


def _timed(code: str, path: Path) -> tuple[float, float]:
    """Processor time [s], the best of three runs, and the most memory held [MB]."""
    found = []
    watch = (
        "import atexit, sys\n"
        "held = lambda: next(l for l in open('/proc/self/status') if 'VmHWM' in l).split()[1]\n"
        "atexit.register(lambda: sys.stderr.write(held()))\n"
    )
    for _ in range(3):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(
            [sys.executable, "-c", watch + code, str(path)], capture_output=True, text=True,
            check=True,
        )  # fmt: skip
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        found.append((spent, int(done.stderr.split()[-1]) / 1e3))
    return min(t for t, _ in found), max(m for _, m in found)


def _written(folder: Path, megabytes: int) -> list[tuple[str, Path]]:
    import mcap.writer
    from rosbags import rosbag1, rosbag2
    from rosbags.typesys import Stores, get_typestore

    from tests.flight_logs import flight, ros_messages

    seconds = max(megabytes * 1e6 / (10 * 100_000 + 100 * 1_500), 20.0)
    made = flight(seconds, 100.0)
    draw = np.random.default_rng(1)
    started = time.time()
    one, two = get_typestore(Stores.ROS1_NOETIC), get_typestore(Stores.ROS2_HUMBLE)
    first = folder / "a.bag"
    with rosbag1.Writer(first) as writer:
        made1 = {}
        for k, (topic, kind, at, message) in enumerate(ros_messages(one, made, True)):
            if topic not in made1:
                made1[topic] = writer.add_connection(topic, kind, typestore=one)
            writer.write(made1[topic], at, one.serialize_ros1(message, kind))
            if k % 30 == 0:
                if "/cloud" not in made1:
                    made1["/cloud"] = writer.add_connection(
                        "/cloud", "std_msgs/msg/UInt8MultiArray", typestore=one
                    )
                writer.write(made1["/cloud"], at, draw.bytes(100_000))
    second = folder / "bag"
    third = folder / "a.mcap"
    with (
        rosbag2.Writer(second, version=9) as writer2,
        third.open("wb") as file,
    ):
        packed = mcap.writer.Writer(file)
        packed.start(profile="ros2", library="benchmark")
        made2, made3 = {}, {}
        for k, (topic, kind, at, message) in enumerate(ros_messages(two, made, False)):
            if topic not in made2:
                made2[topic] = writer2.add_connection(topic, kind, typestore=two)
                text = two.generate_msgdef(kind, ros_version=2)[0].encode()
                made3[topic] = packed.register_channel(
                    topic, "cdr", packed.register_schema(kind, "ros2msg", text)
                )
            data = bytes(two.serialize_cdr(message, kind))
            writer2.write(made2[topic], at, data)
            packed.add_message(made3[topic], at, data, at)
            if k % 30 == 0:
                if "/cloud" not in made2:
                    kind = "std_msgs/msg/UInt8MultiArray"
                    made2["/cloud"] = writer2.add_connection("/cloud", kind, typestore=two)
                    text = two.generate_msgdef(kind, ros_version=2)[0].encode()
                    made3["/cloud"] = packed.register_channel(
                        "/cloud", "cdr", packed.register_schema(kind, "ros2msg", text)
                    )
                writer2.write(made2["/cloud"], at, draw.bytes(100_000))
                packed.add_message(made3["/cloud"], at, draw.bytes(100_000), at)
        packed.finish()
    print(f"written in {time.time() - started:.0f} s", file=sys.stderr)
    return [("ROS 1 bag", first), ("ROS 2 bag", second), ("MCAP", third)]


if __name__ == "__main__":
    main()
