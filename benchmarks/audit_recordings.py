"""A third corpus for `audit`: recordings as drivers, loggers and hosts make them.

Shares no code with the other two.  Each maker imitates one real set-up (a USB serial sensor behind
an FTDI chip, a LiDAR on PTP, a receiver before its almanac, a flight logger with a slow card, a
host that chrony slews, ...) message by message: measured, sent, put on a bus, taken by a driver
when the scheduler lets it, written by a recorder.  `planted`: what is wrong with the stamps;
`allowed`: what may be said besides, since it is true.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

NANO = 10**9
TAI, GPS, GPS_ZERO, WEEK, DAY = 37, 18, 315_964_800, 604_800, 86_400


@dataclass
class Recorded:
    """One stream as a file has it."""

    name: str
    stamp_ns: np.ndarray
    receive_ns: np.ndarray
    planted: tuple[str, ...] = ()
    sizes: dict[str, float] = field(default_factory=dict)
    bound_s: float | None = None
    sound_as: str = ""
    factor: int = 1
    allowed: tuple[str, ...] = ()


@dataclass
class Recording:
    name: str
    streams: tuple[Recorded, ...]
    planted: tuple[str, ...] = ()


class Host:
    """A computer that runs drivers and a recorder; all times in seconds since its log began."""

    def __init__(self, seed: np.random.SeedSequence) -> None:
        self.dice = np.random.default_rng(seed)
        self.length = float(self.dice.choice([60.0, 90.0, 150.0]))
        self.began = 1_650_000_000 + int(self.dice.integers(0, 120_000_000))
        self.wake = float(10 ** self.dice.uniform(-4.3, -3.2))  # of the scheduler, mean

    def ticks(self, rate: float, *, ppm: float | None = None, jitter: float = 0.0) -> np.ndarray:
        """When a sensor of this rate measures, by its own crystal."""
        off = self.dice.normal(0.0, 20.0) if ppm is None else ppm
        step = (1.0 + off * 1e-6) / rate
        when = self.dice.uniform(0.0, 1.0 / rate) + step * np.arange(int(self.length * rate))
        return when + jitter * self.dice.standard_normal(when.size)

    def taken(self, sent: np.ndarray, bus: float, spread: float) -> np.ndarray:
        """When a driver holds what was sent: the bus, then the scheduler, in order."""
        n = sent.size
        waits = bus + spread * self.dice.gamma(2.0, 0.5, n) + self.dice.exponential(self.wake, n)
        late = self.dice.uniform(size=n) < 0.003  # something else ran
        waits += np.where(late, self.dice.uniform(1.0, 6.0, n) * (spread + self.wake), 0.0)
        return np.maximum.accumulate(sent + waits)

    def whole(self, when: np.ndarray, shift: float = 0.0) -> np.ndarray:
        """Nanoseconds since 1970; the shift in seconds may be large."""
        back = int(np.floor(shift))
        return (self.began + back) * NANO + np.rint((when + (shift - back)) * 1e9).astype(np.int64)

    def stream(self, name: str, stamp: np.ndarray, got: np.ndarray, *planted: str,
               shift: float = 0.0, measured: np.ndarray | None = None) -> Recorded:  # fmt: skip
        bound = None if measured is None else float(np.ptp(got - measured))
        return Recorded(name, self.whole(stamp, shift), self.whole(got), planted, bound_s=bound)


Maker = Callable[[Host], list[Recorded]]
SOUND: dict[str, Maker] = {}
FAULTY: dict[str, Maker] = {}


def sound(maker: Maker) -> Maker:
    SOUND[maker.__name__] = maker
    return maker


def faulty(maker: Maker) -> Maker:
    FAULTY[maker.__name__] = maker
    return maker


# ---- sound ------------------------------------------------------------------------------------


@sound
def ros_camera(h: Host) -> list[Recorded]:
    """Stamped by the kernel at the end of the exposure, 15 to 60 Hz; decoded, then published."""
    t = h.ticks(float(h.dice.choice([15.0, 29.97, 30.0, 60.0])), jitter=3e-5)
    return [h.stream("camera", t, h.taken(t, 0.012, 0.004), measured=t)]


@sound
def imu_on_spi(h: Host) -> list[Recorded]:
    """Stamped in the interrupt, 200 to 1000 Hz."""
    t = h.ticks(float(h.dice.choice([200.0, 400.0, 1000.0])), jitter=2e-6)
    return [h.stream("imu", t, h.taken(t, 2e-4, 2e-4), measured=t)]


@sound
def gnss_epochs(h: Host) -> list[Recorded]:
    """Epochs on whole tenths or fifths; computed for 40 to 90 ms, then sent over a serial line."""
    rate = float(h.dice.choice([1.0, 5.0, 10.0]))
    t = np.arange(1.0, h.length, 1.0 / rate)
    return [h.stream("gnss", t, h.taken(t, h.dice.uniform(0.04, 0.09), 0.008), measured=t)]


@sound
def lidar_scans(h: Host) -> list[Recorded]:
    """A scan of 100 ms, stamped at its start, published at its end: late by the scan."""
    t = h.ticks(float(h.dice.choice([10.0, 20.0])), ppm=0.0, jitter=2e-5)
    return [h.stream("lidar", t, h.taken(t, 0.1, 0.003), measured=t)]


@sound
def px4_topics(h: Host) -> list[Recorded]:
    """Scheduled at 250 Hz by the flight controller, logged at 10 or 50."""
    ticks = np.arange(0.0, h.length, 0.004) + 1.5e-4 * h.dice.standard_normal(int(h.length / 0.004))
    t = ticks[:: int(h.dice.choice([5, 25]))]
    return [h.stream("vehicle_attitude", t, h.taken(t, 3e-4, 3e-4), measured=t)]


@sound
def events(h: Host) -> list[Recorded]:
    """Wheel ticks, triggers, detections: no rhythm."""
    t = np.cumsum(h.dice.gamma(float(h.dice.choice([0.7, 2.0, 8.0])), 1.0, 3000))
    t = t / t[-1] * h.length
    return [h.stream("events", t, h.taken(t, 0.002, 0.002), measured=t)]


@sound
def radio_link(h: Host) -> list[Recorded]:
    """Over Wi-Fi: delays with a long tail, episodes of retries, latency that comes and goes."""
    t = h.ticks(float(h.dice.choice([10.0, 20.0, 50.0])), jitter=2e-5)
    waits = 0.004 + 0.004 * h.dice.lognormal(0.0, 0.8, t.size)
    swell = h.dice.uniform(0.004, 0.03) * (1 + np.sin(2 * np.pi * (t / h.dice.uniform(20, 70))))
    bad = (t > 0.3 * h.length) & (t < 0.3 * h.length + 6.0)
    got = np.maximum.accumulate(t + waits + swell + np.where(bad, 3.0 * waits, 0.0))
    return [h.stream("link", t, got, measured=t)]


@sound
def threads_of_a_recorder(h: Host) -> list[Recorded]:
    """Threads note receipts: of messages that come at once some are noted in the wrong order."""
    t = h.ticks(100.0, jitter=1e-5)
    got = np.maximum.accumulate(t + 0.001 + h.dice.exponential(0.005, t.size))
    near = np.flatnonzero((np.diff(got) < 3e-4) & (h.dice.uniform(size=t.size - 1) < 0.5)) + 1
    got[near] -= h.dice.uniform(3e-4, 8e-4, near.size)
    return [h.stream("imu", t, got)]


@sound
def slow_card(h: Host) -> list[Recorded]:
    """The recorder waits for its disk now and then, up to a second: messages come at once after."""
    t = h.ticks(float(h.dice.choice([20.0, 100.0])), jitter=1e-5)
    got = h.taken(t, 0.002, 0.002)
    for begin in h.dice.uniform(3.0, h.length - 3.0, int(h.dice.integers(2, 7))):
        end = begin + h.dice.uniform(0.05, 1.0)
        got = np.where((got > begin) & (got < end), end + 2e-5 * (got - begin), got)
    return [h.stream("imu", t, np.maximum.accumulate(got), measured=t)]


@sound
def frames_of_a_stereo_pair(h: Host) -> list[Recorded]:
    """Left and right in two topics of one trigger; the second waits for the first."""
    t = h.ticks(20.0, jitter=5e-6)
    first = h.taken(t, 0.02, 0.003)
    second = np.maximum.accumulate(first + h.dice.gamma(2.0, 0.001, t.size))
    return [h.stream("left", t, first, measured=t), h.stream("right", t, second, measured=t)]


@sound
def congested_bus(h: Host) -> list[Recorded]:
    """A queue that fills while another sensor bursts and empties afterwards."""
    t = h.ticks(50.0, jitter=1e-5)
    level, queue = 0.0, np.zeros(t.size)
    busy = np.sin(2 * np.pi * t / h.dice.uniform(12.0, 45.0)) > h.dice.uniform(0.2, 0.8)
    for k in range(1, t.size):
        level = min(max(level + (6e-4 if busy[k] else -9e-4), 0.0), 0.12)
        queue[k] = level
    return [h.stream("sonar", t, h.taken(t + queue, 0.003, 0.002))]


@sound
def host_that_chrony_slews(h: Host) -> list[Recorded]:
    """The recorder's clock is slewed into place over tens of seconds; sensors stamp by PPS."""
    size, rate = h.dice.uniform(0.004, 0.02) * h.dice.choice([-1, 1]), h.dice.uniform(2e-4, 5e-4)
    begin = h.dice.uniform(0.1, 0.5) * h.length
    found = []
    for name, hz in (("imu", 100.0), ("gnss", 10.0), ("lidar", 20.0)):
        t = h.ticks(hz, ppm=0.0, jitter=1e-6)
        got = h.taken(t, 0.002, 0.002)
        wrong = np.sign(size) * np.clip(abs(size) - np.maximum(got - begin, 0.0) * rate, 0.0, None)
        one = h.stream(name, t, np.maximum.accumulate(got + wrong))
        one.allowed = ("recorder_clock", "ahead_of_receipt")
        found.append(one)
    return found


# ---- faulty -----------------------------------------------------------------------------------


@faulty
def usb_serial_imu(h: Host) -> list[Recorded]:
    """An FTDI chip hands over every 16 ms (or 62 bytes); the driver stamps what it reads."""
    t = h.ticks(float(h.dice.choice([50.0, 100.0, 125.0, 200.0])), jitter=1e-5)
    timer = float(h.dice.choice([0.016, 0.016, 0.008]))
    if timer == 0.008:  # at 125 Hz one sample a packet, which nothing shows
        t = h.ticks(float(h.dice.choice([50.0, 100.0, 200.0])), jitter=1e-5)
    phase = h.dice.uniform(0.0, timer)
    packet = np.ceil((t - phase) / timer) * timer + phase
    read = packet + np.repeat(h.dice.exponential(5e-5, t.size)[:1], t.size)
    got = np.maximum.accumulate(read + h.dice.gamma(2.0, 1e-4, t.size))
    return [h.stream("imu", read, got, "packetised")]


@faulty
def fifo_of_an_imu(h: Host) -> list[Recorded]:
    """Samples wait in the chip's FIFO until it holds so many; all get the time of the read."""
    rate, depth = float(h.dice.choice([100.0, 200.0, 400.0])), int(h.dice.choice([4, 8, 10, 16]))
    t = h.ticks(rate, jitter=1e-6)
    t = t[: t.size // depth * depth]
    read = np.repeat(t.reshape(-1, depth)[:, -1], depth) + 2e-4
    got = np.maximum.accumulate(read + np.repeat(h.dice.gamma(2.0, 2e-4, t.size // depth), depth)
                                + 1e-6 * np.tile(np.arange(depth), t.size // depth))  # fmt: skip
    return [h.stream("imu", read, got, "packetised")]


@faulty
def driver_that_stamps_on_arrival(h: Host) -> list[Recorded]:
    """`now()` in the callback."""
    t = h.ticks(float(h.dice.choice([10.0, 50.0, 100.0])), jitter=1e-5)
    stamp = h.taken(t, 0.004, h.dice.uniform(0.0015, 0.004))
    return [h.stream("sensor", stamp, stamp + h.dice.gamma(2.0, 2e-5, t.size),
                     "stamped_on_arrival")]  # fmt: skip


@faulty
def lidar_on_ptp(h: Host) -> list[Recorded]:
    """PTP tells TAI; nobody takes the 37 s off."""
    t = h.ticks(float(h.dice.choice([10.0, 20.0])), ppm=0.0)
    return [h.stream("lidar", t, h.taken(t, 0.1, 0.002), "epoch_offset", shift=TAI, measured=t)]


@faulty
def lidar_by_its_own_oscillator(h: Host) -> list[Recorded]:
    """Nanoseconds since power on, and a crystal of its own."""
    up, ppm = h.dice.uniform(20.0, 4000.0), h.dice.choice([-1, 1]) * h.dice.uniform(30.0, 90.0)
    t = h.ticks(10.0, ppm=0.0)
    return [h.stream("lidar", t * (1 + ppm * 1e-6) + up, h.taken(t, 0.1, 2e-4), "epoch_offset",
                     "drift", shift=-h.began)]  # fmt: skip


@faulty
def receiver_before_its_almanac(h: Host) -> list[Recorded]:
    """GPS time as UTC until the leap seconds are known, 5 to 30 s in."""
    t = np.arange(1.0, h.length, 0.2)
    stamp = t + np.where(t < h.dice.uniform(5.0, 30.0), GPS, 0.0)
    return [h.stream("gnss", stamp, h.taken(t, 0.06, 0.006), "epoch_offset")]


@faulty
def receiver_in_gps_time(h: Host) -> list[Recorded]:
    t = np.arange(1.0, h.length, 0.1)
    return [h.stream("gnss", t, h.taken(t, 0.05, 0.006), "epoch_offset", shift=GPS, measured=t)]


@faulty
def nmea_labelled_with_another_second(h: Host) -> list[Recorded]:
    """The message after the pulse is paired with the pulse before it, all along or for a while."""
    t = np.arange(1.0, h.length, float(h.dice.choice([1.0, 0.2])))
    begin = h.dice.uniform(0.2, 0.5) * h.length
    away = np.ones(t.size, bool) if h.dice.uniform() < 0.5 else (t > begin) & (t < begin + 12.0)
    stamp = t + np.where(away, float(h.dice.choice([-1.0, 1.0])), 0.0)
    return [h.stream("nmea", stamp, h.taken(t, 0.03, 0.004), "whole_second_slip")]


@faulty
def clock_of_no_battery(h: Host) -> list[Recorded]:
    """A recorder of its own, set by hand some seconds wrong."""
    t = h.ticks(20.0)
    back = h.dice.uniform(1.2, 40.0)
    back += 0.3 * (abs(back - round(back)) < 0.15 or min(abs(back - s) for s in (18, 19, 37)) < 1)
    return [h.stream("camera", t, h.taken(t, 0.01, 0.003), "epoch_offset", shift=-back,
                     measured=t)]  # fmt: skip


@faulty
def seconds_of_the_day(h: Host) -> list[Recorded]:
    """GGA without a date."""
    t = np.arange(1.0, h.length, 0.2)
    if (h.began + h.length) // DAY != h.began // DAY:
        h.began += 3600
    return [h.stream("gga", t, h.taken(t, 0.04, 0.005), "epoch_offset",
                     shift=float(-(h.began // DAY * DAY)), measured=t)]  # fmt: skip


@faulty
def seconds_of_the_week(h: Host) -> list[Recorded]:
    """iTOW, SBET."""
    t = np.arange(1.0, h.length, 0.05)
    tow = (h.began - GPS_ZERO + GPS) % WEEK
    if tow + h.length > WEEK:
        h.began -= 7200
        tow -= 7200
    return [h.stream("ins", t, h.taken(t, 0.02, 0.003), "epoch_offset",
                     shift=float(tow - h.began), measured=t)]  # fmt: skip


@faulty
def logger_of_another_zone(h: Host) -> list[Recorded]:
    hours = float(h.dice.choice([-8.0, -7.0, -4.0, 1.0, 2.0, 3.5, 5.5, 5.75, 8.0, 9.0]))
    t = h.ticks(10.0)
    return [h.stream("weather", t, h.taken(t, 0.01, 0.004), "epoch_offset", shift=3600 * hours,
                     measured=t)]  # fmt: skip


@faulty
def milliseconds_as_seconds(h: Host) -> list[Recorded]:
    """Java, JavaScript, Windows: milliseconds (or micro-, nanoseconds) since 1970 in `stamp_s`."""
    t = h.ticks(20.0, jitter=1e-5)
    one = h.stream("gateway", t, h.taken(t, 0.005, 0.003), "epoch_offset")
    one.factor = int(h.dice.choice([10**3, 10**6, 10**9]))
    return [one]


@faulty
def seconds_read_as_nanoseconds(h: Host) -> list[Recorded]:
    """A converter that took a float of seconds, or microseconds, for nanoseconds."""
    t = h.ticks(100.0, jitter=1e-5)
    one = h.stream("imu", t, h.taken(t, 0.002, 0.002), "epoch_offset")
    one.stamp_ns = one.stamp_ns // int(h.dice.choice([10**3, 10**6]))
    one.allowed = ("truncated_stamps",)
    return [one]


@faulty
def counter_of_a_bus(h: Host) -> list[Recorded]:
    """16 bits of 10 us or of ms, 24 of 100 ns, 32 of us, of ns; a second's fraction alone."""
    size = int(h.dice.choice([2**16 * 10**4, 2**16 * 10**6, 2**24 * 100, 2**32, 10**9, 60 * NANO,
                              2**15 * 10**5, 2**24 * 10**3, 2**16 * 10**5]))  # fmt: skip
    t = h.ticks(float(h.dice.choice([50.0, 100.0])), jitter=1e-5)
    one = h.stream("can", t, h.taken(t, 0.001, 0.002), "counter_wrap", measured=t)
    size = min(size, int(0.4 * h.length) * NANO) if size > h.length * 5e8 else size
    one.stamp_ns = (one.stamp_ns - h.began * NANO + int(h.dice.integers(0, size))) % size
    one.sizes["wrap_s"] = size / 1e9
    return [one]


@faulty
def windows_clock(h: Host) -> list[Recorded]:
    """Ticks of 1/64 s."""
    t = h.ticks(float(h.dice.choice([20.0, 33.0, 47.0])), jitter=1e-5)
    one = h.stream("camera", t, h.taken(t, 0.01, 0.003), "truncated_stamps")
    one.stamp_ns = one.stamp_ns // 15_625_000 * 15_625_000
    return [one]


@faulty
def printed_with_few_digits(h: Host) -> list[Recorded]:
    """`%.3f`, `%.2f`."""
    t = h.ticks(float(h.dice.choice([23.0, 30.0, 62.0, 119.0])), jitter=1e-5)
    one = h.stream("text", t, h.taken(t, 0.004, 0.002), "truncated_stamps")
    grain = int(h.dice.choice([10**6, 10**7]))
    one.stamp_ns = (one.stamp_ns + grain // 2) // grain * grain
    return [one]


@faulty
def crystal_of_a_sensor(h: Host) -> list[Recorded]:
    """Synchronised once, at the start, then on its own."""
    ppm = h.dice.choice([-1, 1]) * h.dice.uniform(20.0, 150.0)
    t = h.ticks(float(h.dice.choice([50.0, 200.0])), ppm=0.0)
    return [h.stream("imu", t * (1 + ppm * 1e-6), h.taken(t, 0.001, 4e-4), "drift")]


@faulty
def timesync_that_starts_again(h: Host) -> list[Recorded]:
    """A bridge estimates the offset of a boot clock; after a reset the estimate settles anew."""
    t = h.ticks(50.0, ppm=0.0, jitter=1e-5)
    at, size = h.dice.uniform(0.3, 0.6) * h.length, h.dice.uniform(0.05, 0.4)
    tau = h.dice.uniform(2.0, 6.0)
    away = np.where(t >= at, np.exp(-np.maximum(t - at, 0.0) / tau), 0.0)
    size *= h.dice.choice([-1, 1])
    return [h.stream("mavros", t + size * away, h.taken(t, 0.004, 0.003), "relock")]


@faulty
def clock_stepped_by_ntp(h: Host) -> list[Recorded]:
    """The sensor's computer steps its clock once; the recorder's does not."""
    t = h.ticks(float(h.dice.choice([20.0, 100.0])), ppm=0.0, jitter=1e-5)
    size = h.dice.choice([-1, 1]) * h.dice.uniform(0.02, 0.45)
    stamp = t + np.where(t > h.dice.uniform(0.25, 0.75) * h.length, size, 0.0)
    one = h.stream("camera", stamp, h.taken(t, 0.01, 0.003), "step")
    one.allowed = ("ahead_of_receipt",)
    return [one]


@faulty
def recorder_stepped_by_chrony(h: Host) -> list[Recorded]:
    """`makestep`: receipts of all streams jump."""
    at, size = (
        h.dice.uniform(0.3, 0.7) * h.length,
        h.dice.choice([-1, 1]) * h.dice.uniform(0.1, 2.6),
    )
    found = []
    for name, hz in (("imu", 100.0), ("gnss", 10.0), ("camera", 30.0)):
        t = h.ticks(hz, jitter=1e-5)
        got = h.taken(t, 0.003, 0.002)
        found.append(h.stream(name, t, got + np.where(got > at, size, 0.0), "recorder_clock"))
    return found


@faulty
def frames_dropped(h: Host) -> list[Recorded]:
    t = h.ticks(30.0, jitter=2e-5)
    got = h.taken(t, 0.012, 0.004)
    kept = h.dice.uniform(size=t.size) > h.dice.uniform(0.005, 0.04)
    kept[[0, -1]] = True
    kept[t.size // 3] = False
    return [h.stream("camera", t[kept], got[kept], "lost_messages")]


@faulty
def cable_pulled(h: Host) -> list[Recorded]:
    t = h.ticks(float(h.dice.choice([10.0, 100.0])), jitter=1e-5)
    begin = h.dice.uniform(0.3, 0.6) * h.length
    kept = (t < begin) | (t > begin + h.dice.uniform(2.0, 9.0))
    got = h.taken(t, 0.004, 0.002)
    return [h.stream("sensor", t[kept], got[kept], "gap")]


@faulty
def frames_sent_twice(h: Host) -> list[Recorded]:
    t = h.ticks(25.0, jitter=1e-5)
    twice = np.sort(h.dice.choice(np.arange(5, t.size - 5), int(h.dice.integers(2, 15)), False))
    t = np.insert(t, twice, t[twice])
    got = h.taken(t, 0.01, 0.003)
    return [h.stream("camera", t, got + 1e-6 * np.arange(t.size) / t.size, "duplicates")]


@faulty
def unset_until_synchronised(h: Host) -> list[Recorded]:
    t = h.ticks(float(h.dice.choice([10.0, 50.0])), jitter=1e-5)
    one = h.stream("sensor", t, h.taken(t, 0.003, 0.002), "unset_stamps")
    one.stamp_ns[: int(h.dice.integers(3, 200))] = 0
    return [one]


@faulty
def extrapolated_into_the_future(h: Host) -> list[Recorded]:
    """A filter stamps what it predicts."""
    t = h.ticks(50.0, jitter=1e-5)
    ahead = h.dice.uniform(0.03, 0.3)
    return [h.stream("odometry", t + ahead, h.taken(t, 0.002, 0.002), "ahead_of_receipt",
                     measured=t)]  # fmt: skip


def corpus(seed: int, each: int = 8, sound_each: int = 20) -> Iterator[Recording]:
    """All set-ups, each so many times."""
    seeds = iter(np.random.SeedSequence([seed, 991]).spawn(4096))
    for makers, times in ((FAULTY, each), (SOUND, sound_each)):
        for name, maker in makers.items():
            for k in range(times):
                streams = maker(Host(next(seeds)))
                for one in streams:
                    one.name = f"{name}_{k}_{one.name}"
                    one.sound_as = "" if one.planted else name
                yield Recording(f"{name}_{k}", tuple(streams))
