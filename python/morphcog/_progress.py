"""How far a command is: a bar, a line that changes, or lines from time to time; and callbacks."""

import json
import sys
import threading
import time
import warnings


def tqdm_class():
    """tqdm for notebooks or terminals, if it is installed."""
    try:
        with warnings.catch_warnings():
            # Without ipywidgets, a notebook gets the bar of terminals.
            warnings.simplefilter("ignore")
            from tqdm.auto import tqdm
    except ImportError:
        return None
    return tqdm


class Progress:
    """Listens to a command. On stderr it says how far the command is: in a terminal and in a notebook by tqdm's
    bar, or without tqdm in one line that changes; elsewhere in lines from time to time. Warnings are Python's.
    The callback gets a dict of every generation and finding."""

    def __init__(self, quiet, callback=None):
        self._stream, self._callback = None if quiet else sys.stderr, callback
        moves = getattr(self._stream, "isatty", bool)() or type(self._stream).__module__.startswith("ipykernel")
        self._moves, self._least = moves, 0.5 if moves else 10.0
        self._tqdm = tqdm_class() if moves else None
        self._bar, self._generations = None, None
        self._begun = self._said = time.monotonic()
        self._text, self._shown = "", ""

    @property
    def waits(self):
        """True if the command is to wait for the callback."""
        return self._callback is not None

    def __call__(self, kind, text, fields):
        if kind == "warning":
            warnings.warn(text, stacklevel=3)
        elif kind == "note":
            self._note(text)
        elif kind == "begins":
            if self._tqdm:
                self._open(**json.loads(fields))
        elif kind == "progress":
            self._move(text, fields)
        elif kind == "generation":
            fields = json.loads(fields)
            return self._generation(text, fields)
        elif self._callback:
            return self._asks_to_stop(json.loads(fields))
        return False

    def _generation(self, text, now):
        done, is_first = now["generation"], self._generations is None
        self._generations = done
        if self._tqdm:
            if is_first:
                self._open("evolving", now["generations"], done, "generations")
            best = "none" if now["best"] is None else f"{now['best']:.2f}"
            self._bar.set_postfix(best=best, coverage=f"{now['coverage']:.1%}", refresh=False)
            self._bar.update(done - self._bar.n)
        else:
            self._line(text)
        # The first is of what was done before.
        return bool(self._callback) and not is_first and self._asks_to_stop({"event": "generation", **now})

    def _asks_to_stop(self, event):
        try:
            return self._callback(event) is True
        except StopIteration:
            return True

    def _open(self, label, total, done, unit):
        self._close()
        scale = unit == "bytes"
        self._bar = self._tqdm(
            desc=label.rstrip(":"), total=total, initial=done, unit="B" if scale else f" {unit}", unit_scale=scale
        )

    def _close(self):
        if self._bar is not None:
            self._bar.close()
            self._bar = None

    def _move(self, text, fields):
        if self._bar is None:
            self._line(text)
        else:
            self._bar.update(json.loads(fields)["done"] - self._bar.n)

    def _note(self, text):
        if self._tqdm:
            self._tqdm.write(text, file=self._stream)
        else:
            self._write(f"{self._over(text)}\n")
            self._shown = ""

    def _line(self, text):
        self._text = text
        # The longer it takes, the less often: a log of hours stays short.
        now = time.monotonic()
        if now - self._said >= max(self._least, (now - self._begun) / 200):
            self._said = now
            self._show()

    def _over(self, text):
        """A text in the place of the line that is shown."""
        return f"\r{text:<{len(self._shown)}}" if self._moves and self._shown else text

    def _show(self):
        end = "" if self._moves else "\n"
        self._write(self._over(self._text) + end)
        self._shown = self._text

    def _write(self, text):
        if self._stream is not None:
            self._stream.write(text)
            self._stream.flush()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._close()
        if self._text != self._shown:
            self._show()
        if self._moves and self._text:
            self._write("\n")


def main_is_interrupted():
    """True in another thread than the main one while Ctrl-C ends that, which would wait for this one."""
    main = threading.main_thread()
    if threading.current_thread() is main:
        return False
    handled = getattr(sys, "_current_exceptions", dict)().get(main.ident)
    found = handled[1] if isinstance(handled, tuple) else handled
    return isinstance(found if main.is_alive() else getattr(sys, "last_value", None), KeyboardInterrupt)
