"""Makes a whole bag of what a truncated or damaged one still holds.

A chunk is taken whole when its CRC is right and skipped when it is not: no message comes through
that is not, byte for byte, what was recorded. Messages outside of chunks have no CRC of their own;
they are taken too, and reported as unchecked where the file is damaged.
"""

from collections.abc import Callable
from pathlib import Path
from typing import IO, Final

from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, Schema

from sain_bags.bag.metadata import METADATA_RECORD, START_RECORD, read_record
from sain_bags.bag.parts import CUT_OFF
from sain_bags.mcap.integrity import MESSAGE_HEAD, OpenedChunk
from sain_bags.mcap.mcap_file import McapFile
from sain_bags.mcap.scanner import Gap, Record, Scanner, is_exact, parse
from sain_bags.recovery.bag_copy import BagCopy
from sain_bags.recovery.recovery_report import FileReport, Loss, RecoveryOutcome, Report
from sain_bags.recovery.sidecar import Sidecar, complete_sidecar, read_sidecar
from sain_core.errors import DatasetError, OutputError, UntrustedFileError
from sain_core.guarding.untrusted import open_regular

ABOUT_BAG: Final = (METADATA_RECORD, START_RECORD)

Advance = Callable[[int], object]  # called with the number of bytes that were read


def recover(source: Path, out: Path, advance: Advance = lambda done: None) -> Report:
    """Write a new bag with all that is undamaged in another; none where nothing is.

    Args:
        source: a bag's folder, also without ``metadata.yaml``, or an MCAP file.
        out: the new bag's folder, which must not exist.
        advance: called after each record.

    Raises:
        DatasetError: there is no MCAP file at the source.
        OutputError: the new folder exists, or the source or the disk cannot be used.
    """
    sidecar = read_sidecar(source)
    try:
        with BagCopy(out) as copy:
            files = tuple(_recover_file(path, copy, advance) for path in sidecar.files)
            about = next((file.about for file in reversed(files) if file.about), {})
            was_more = any(file.described_bag for file in files)
            sidecar = complete_sidecar(sidecar, about, was_more)
            report = Report(files, copy.counts, copy.span, sidecar)
            if report.outcome != RecoveryOutcome.NOTHING:
                copy.finish(_custom_data(sidecar, report, source), sidecar.ros_distro)
            return report
    except OutputError:
        raise
    except OSError as error:
        reason = error.strerror or error
        raise OutputError(f"cannot recover {source} to {out}: {reason}") from error


def _custom_data(sidecar: Sidecar, report: Report, source: Path) -> dict[str, str]:
    """Return the custom data of the new bag; they state losses."""
    if report.outcome == RecoveryOutcome.LOSSLESS:
        return dict(sidecar.custom_data)
    return {**sidecar.custom_data, "recovered": f"with losses, from {source.name}"}


def _recover_file(path: Path, copy: BagCopy, advance: Advance) -> FileReport:
    with _opened(path) as stream:
        scanner = Scanner(stream)
        is_earlier = path.parent.suffix == CUT_OFF
        name = f"{path.parent.name}/{path.name}" if is_earlier else path.name
        salvage = _Salvage(FileReport(name, scanner.size), copy, scanner)
        salvage.expect(path)
        place = 0
        for found in scanner:
            salvage.take(found)
            advance(found.end - place)
            place = found.end
        return salvage.finish(scanner)


def _opened(path: Path) -> IO[bytes]:
    try:
        return open_regular(path)
    except UntrustedFileError as error:
        raise DatasetError(f"{path} is not read: {error}") from error


class _Salvage:
    """One file's records on their way into the new bag."""

    def __init__(self, report: FileReport, copy: BagCopy, scanner: Scanner) -> None:
        self._report, self._copy, self._scanner = report, copy, scanner
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._numbers: dict[int, int] = {}  # of channels, here and in the copy
        self._unchecked: set[int] = set()  # channels whose description has no CRC
        self._chunk = 0
        self._last_time: int | None = None
        self._loss: Loss | None = None  # the latest, until a message after it is saved
        self._open: list[Loss] = []  # those without a message after them so far

    def expect(self, path: Path) -> None:
        """Learn what the file once had from its summary, where a CRC verifies that."""
        try:
            file = McapFile(path)
        except DatasetError:
            return
        statistics, report, channels = file.statistics, self._report, file.channels
        if not file.is_verified or not statistics.channel_message_counts.keys() <= channels.keys():
            return
        self._declare(list(file.schemas.values()), list(channels.values()))
        expected = {channel.topic: 0 for channel in channels.values()}
        for number, count in statistics.channel_message_counts.items():
            expected[channels[number].topic] += count
        about_bag = sum(name in ABOUT_BAG for name in file.metadata)
        report.expected, report.described_bag = expected, about_bag > 0
        extras = statistics.attachment_count + statistics.metadata_count
        report.expected_extras = extras - about_bag

    def take(self, found: Record | Gap) -> None:
        """Save a record, or note what is lost."""
        if isinstance(found, Gap):
            self._chunk += found.is_chunk
            self._lose(found, found.reason, is_chunk=found.is_chunk)
        elif found.opcode == Opcode.CHUNK:
            self._take_chunk(found)
        elif found.opcode == Opcode.MESSAGE:
            if not self._write(memoryview(found.content), checked=False):
                self._lose(found, "its channel is not known", messages=1)
        elif found.opcode == Opcode.MESSAGE_INDEX:
            self._count_lost(found)
        elif found.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            self._take_description(found)
        elif found.opcode in (Opcode.METADATA, Opcode.ATTACHMENT):
            self._take_extra(found)

    def finish(self, scanner: Scanner) -> FileReport:
        """Return the report of the whole file."""
        report = self._report
        report.ended, report.matches = scanner.ended, scanner.matches
        if not report.ended and (self._loss is None or self._loss.end < scanner.size):
            end = Gap(scanner.size, scanner.size, False, "the recording has no end")
            self._lose(end, end.reason)
        for topic in {channel.topic for channel in self._channels.values()}:
            report.counts.setdefault(topic, 0)
        return report

    def _take_chunk(self, record: Record) -> None:
        self._chunk += 1
        try:
            opened = self._scanner.open_chunk(record)
            self._declare(*_descriptions(opened), checked=opened.checked)
        except DatasetError as error:
            self._lose(record, str(error), is_chunk=True)
            return
        self._report.chunks += 1
        orphans = 0
        for opcode, content in opened.records():
            if opcode == Opcode.MESSAGE:
                orphans += not self._write(content, opened.checked)
        if orphans:
            reason = "the description of a channel was lost before"
            self._lose(record, reason, is_chunk=True, messages=orphans)
            self._loss = None  # the index behind the chunk counts also those that were saved

    def _take_description(self, record: Record) -> None:
        found = parse(record.opcode, record.content)
        try:
            if record.opcode == Opcode.SCHEMA:
                self._declare([found], [], checked=False)
            else:
                self._declare([], [found], checked=False)
        except DatasetError as error:
            self._lose(record, str(error))

    def _declare(
        self, schemas: list[Schema], channels: list[Channel], checked: bool = True
    ) -> None:
        """Learn descriptions, all or, where they contradict what is known, none."""
        changed = any(self._schemas.get(schema.id, schema) != schema for schema in schemas)
        if changed or any(self._channels.get(one.id, one) != one for one in channels):
            raise DatasetError("it describes a channel otherwise than the file does before")
        self._schemas |= {schema.id: schema for schema in schemas}
        self._channels |= {channel.id: channel for channel in channels}
        for channel in channels:
            schema = self._schemas.get(channel.schema_id)
            lost = channel.schema_id and schema is None  # its messages could not be decoded
            if channel.id not in self._numbers and not lost:
                self._numbers[channel.id] = self._copy.add_channel(channel, schema)
                if not checked:
                    self._unchecked.add(channel.id)

    def _write(self, content: memoryview, checked: bool) -> bool:
        """Save a message; return whether its channel is known."""
        channel, sequence, received, published = MESSAGE_HEAD.unpack_from(content)
        number = self._numbers.get(channel)
        if number is None:
            return False
        data = bytes(content[MESSAGE_HEAD.size :])
        self._copy.write(number, sequence, received, published, data)
        topic = self._channels[channel].topic
        self._report.counts[topic] = self._report.counts.get(topic, 0) + 1
        self._report.unchecked += not checked or channel in self._unchecked
        self._last_time = max(self._last_time or received, received)
        for loss in self._open:
            loss.before = received
        self._open.clear()
        self._loss = None
        return True

    def _take_extra(self, record: Record) -> None:
        extra = parse(record.opcode, record.content)
        if isinstance(extra, Metadata) and extra.name in ABOUT_BAG:  # it is made anew
            self._report.about = read_record(extra) or self._report.about
        else:
            self._report.extras += 1
            self._copy.add_extra(extra)

    def _lose(
        self, place: Record | Gap, reason: str, is_chunk: bool = False, messages: int | None = None
    ) -> None:
        number = self._chunk if is_chunk else None
        name = self._report.name
        self._loss = Loss(name, place.start, place.end, reason, number, messages, self._last_time)
        self._report.losses.append(self._loss)
        self._open.append(self._loss)

    def _count_lost(self, record: Record) -> None:
        """Count, from the index behind it, the messages of a chunk that was skipped."""
        if self._loss is not None and self._loss.chunk is not None:
            self._loss.messages = (self._loss.messages or 0) + (len(record.content) - 6) // 16


def _descriptions(opened: OpenedChunk) -> tuple[list[Schema], list[Channel]]:
    schemas: list[Schema] = []
    channels: list[Channel] = []
    for opcode, content in opened.records():
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            if not is_exact(opcode, content):
                raise DatasetError("a description in it is damaged")
            found = parse(opcode, content)
            schemas.append(found) if opcode == Opcode.SCHEMA else channels.append(found)
    return schemas, channels
