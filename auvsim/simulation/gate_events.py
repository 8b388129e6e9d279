"""What the log says of a gate: which source it begins to refuse, and which it hears again."""

from collections.abc import Collection, Iterable, Iterator, MutableMapping

from estimators.core.types import Outcome


def gate_events(
    noun: str,
    counts: MutableMapping[str, int],
    suspects: Collection[str],
    refused: Iterable[Outcome],
    heard: Iterable[str],
) -> Iterator[tuple[str, str]]:
    """Kind and text of each event of what a gate has just judged.

    Args:
        noun: what it judges, "reading" or "message".
        counts: how many it refused in a row, by source; cleared of each source that is heard again.
        suspects: sources that had been refused last before these were judged.
        refused: fates of those refused now.
        heard: sources of those that passed.
    """
    for outcome in refused:
        source = outcome.source or outcome.kind
        if source not in suspects:
            yield "refused", f"{noun}s of {source}: {outcome.reason.replace('_', ' ')}"
    for source in heard if suspects else ():
        if (count := counts.pop(source, 0)) > 0:
            yield "heard", f"{source} is heard again; {count} {noun}{'s' * (count > 1)} refused"
