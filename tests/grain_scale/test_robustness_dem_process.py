"""LAMMPS that is missing, fails, hangs or writes nonsense raises an exception each time."""

import os
import signal
import subprocess
import sys
import time

import pytest

from granular.grain_scale import dem
from granular.grain_scale.dem import process

SHEAR = dem.Shear(count=60)


def script(text):
    """Command that runs Python code in place of LAMMPS."""
    return (sys.executable, "-c", text)


def test_what_cannot_be_started_is_told(monkeypatch):
    """A command that does not exist; without LAMMPS the message says what to install."""
    with pytest.raises(dem.DemError, match="cannot be started by '/no/such/lmp'"):
        dem.shear(SHEAR, command=("/no/such/lmp",))
    with pytest.raises(TypeError, match="sequence of strings"):
        dem.shear(SHEAR, command="lmp")
    monkeypatch.setattr(process, "find_spec", lambda name: None)
    with pytest.raises(ImportError, match=r"pip install 'granular-flow\[dem\]'"):
        dem.shear(SHEAR)


def test_what_lammps_says_is_told_without_the_paths_of_its_build():
    said = "ERROR: Out of range atoms (src/src/domain.cpp:12)\nLast input line: run 5\n"
    with pytest.raises(dem.DemError) as caught:
        dem.shear(SHEAR, command=script(f"print({said!r}); raise SystemExit(3)"))
    message = str(caught.value)
    assert "status 3" in message
    assert "ERROR: Out of range atoms; Last input line: run 5" in message
    assert "domain.cpp" not in message
    # the signal that ended it is told as well
    text = "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)"
    with pytest.raises(dem.DemError, match="status 139"):
        dem.shear(SHEAR, command=script(text))


def test_a_run_that_hangs_is_ended_with_all_it_started(tmp_path):
    """Child processes of the child are ended as well: the wheel starts its program in this way."""
    note = tmp_path / "pid"
    child = "import time; time.sleep(60)"
    text = (
        "import subprocess, sys\n"
        f"child = subprocess.Popen([sys.executable, '-c', {child!r}])\n"
        f"open({str(note)!r}, 'w').write(str(child.pid))\n"
        "print('step 7', flush=True)\n"
        "child.wait()\n"
    )
    with pytest.raises(dem.DemError, match=r"timeout = 1.5 s; its last output: step 7"):
        dem.shear(SHEAR, command=script(text), timeout=1.5)
    pid = int(note.read_text())
    assert _soon(lambda: not _alive(pid), 5)
    with pytest.raises(ValueError, match="timeout = 0"):
        dem.shear(SHEAR, timeout=0)


KILLED = """
import sys, tempfile
tempfile.tempdir = sys.argv[1]
from granular.grain_scale import dem
dem.shear(dem.Shear(count=60), command=(sys.executable, "-c", sys.argv[2]))
"""

GROUP = """
import os, subprocess, sys, time
{first}
child = subprocess.Popen([sys.executable, "-c", "import time; {first}; time.sleep(60)"])
with open({note!r} + "~", "w") as file:
    file.write(f"{{os.getpid()}} {{child.pid}}")
os.rename({note!r} + "~", {note!r})
child.wait()
"""


@pytest.mark.parametrize("sent, stubborn", [(signal.SIGTERM, False), (signal.SIGKILL, True)])
def test_nothing_goes_on_when_the_process_that_asked_is_killed(tmp_path, sent, stubborn):
    """No child process and no folder is left, even if the processes ignore SIGTERM."""
    note, folder = tmp_path / "pids", tmp_path / "temporary"
    folder.mkdir()
    deaf = "import signal; signal.signal(signal.SIGTERM, signal.SIG_IGN)" if stubborn else "pass"
    text = GROUP.format(note=str(note), first=deaf)
    asking = subprocess.Popen([sys.executable, "-c", KILLED, str(folder), text])
    try:
        assert _soon(note.exists, 60)
        pids = [int(pid) for pid in note.read_text().split()]
        assert all(map(_alive, pids))
        assert any(folder.iterdir())
    finally:
        asking.send_signal(sent)
        asking.wait()
    assert _soon(lambda: not any(map(_alive, pids)), 10)
    assert _soon(lambda: not any(folder.iterdir()), 1)


def _soon(what, seconds):
    """True if the condition becomes true before the time limit."""
    end = time.monotonic() + seconds
    while not what():
        if time.monotonic() > end:
            return False
        time.sleep(0.02)
    return True


def _alive(pid):
    try:
        os.kill(pid, 0)
        with open(f"/proc/{pid}/stat") as file:
            return file.read().rsplit(")", 1)[1].split()[0] != "Z"
    except (ProcessLookupError, FileNotFoundError):
        return False


def test_a_run_without_output_or_grains_is_no_result():
    with pytest.raises(dem.DemError, match="has not written its file 'atoms'"):
        dem.shear(SHEAR, command=script("pass"))
    text = (
        "head = 'ITEM: TIME\\n0\\nITEM: TIMESTEP\\n0\\nITEM: NUMBER OF {}\\n0\\n'\n"
        "box = 'ITEM: BOX BOUNDS pp pp pp\\n0 1\\n0 1\\n0 1\\nITEM: {} {}\\n'\n"
        "for name, what, n in (('atoms', 'ATOMS', 16), ('contacts', 'ENTRIES', 15)):\n"
        "    names = ' '.join(map(str, range(n)))\n"
        "    open(name, 'w').write(head.format(what) + box.format(what, names))\n"
    )
    with pytest.raises(dem.DemError, match="no grains"):
        dem.shear(SHEAR, command=script(text))
