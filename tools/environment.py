#!/usr/bin/env python3
"""Make the environment that the Makefile's targets run in: Blender as a Python module, and the development tools.

    python3 tools/environment.py [--blender 5.3 | 5.2 | 5.0 | 4.5]

Runs under any Python from 3.8 on and needs nothing but its standard library. In order, each step only when it is due:

1. find the Python that this Blender needs (3.13 for 5.2 and 5.3, 3.11 for the older ones),
2. make a virtual environment with it, `.venv` for 5.2 and `.venv-5.3`, `.venv-5.0`, `.venv-4.5`,
3. install what `[dependency-groups]` in pyproject.toml pins,
4. look for the system libraries that Blender loads, and name the Debian packages of those that are missing.

A stamp inside the environment records what was installed, so that a call with nothing to do costs milliseconds. An
installation that was interrupted is started again from an empty environment.
"""

import hashlib
import json
import os
import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent

# Blender version -> the Python it is built for, and the folder of its environment.
PYTHON_OF = {"5.3": "3.13", "5.2": "3.13", "5.0": "3.11", "4.5": "3.11"}
FOLDER_OF = {"5.3": ".venv-5.3", "5.2": ".venv", "5.0": ".venv-5.0", "4.5": ".venv-4.5"}
# What stands in for a Blender whose Python is not on this machine.
FALLBACK_OF = {"5.2": "5.0"}

# The system libraries that the bpy wheels need and do not bring along, with the Debian package of each.
PACKAGE_OF = {
    "libEGL.so.1": "libegl1",
    "libGL.so.1": "libgl1",
    "libGLX.so.0": "libglx0",
    "libICE.so.6": "libice6",
    "libOpenGL.so.0": "libopengl0",
    "libSM.so.6": "libsm6",
    "libX11.so.6": "libx11-6",
    "libXext.so.6": "libxext6",
    "libXfixes.so.3": "libxfixes3",
    "libXi.so.6": "libxi6",
    "libXrender.so.1": "libxrender1",
    "libXxf86vm.so.1": "libxxf86vm1",
    "libgomp.so.1": "libgomp1",
    "libstdc++.so.6": "libstdc++6",
    "libuuid.so.1": "libuuid1",
    "libvulkan.so.1": "libvulkan1",
    "libwayland-client.so.0": "libwayland-client0",
    "libxcb.so.1": "libxcb1",
    "libxkbcommon.so.0": "libxkbcommon0",
}
# Mesa: the OpenGL driver, in software where there is no GPU.
DRIVER_PACKAGES = ["libegl-mesa0", "libgl1-mesa-dri"]


def main(arguments):
    blender = parse(arguments)
    if blender not in PYTHON_OF:
        fail("There is no environment for Blender %s: BLENDER is one of %s." % (blender, ", ".join(PYTHON_OF)))
    groups = dependency_groups((ROOT / "pyproject.toml").read_text(encoding="utf-8"))

    folder = ROOT / FOLDER_OF[blender]
    stamp = read_stamp(folder)
    if is_current(stamp, blender, groups, folder):
        if stamp["blender"] != blender:
            say_fallback(blender, stamp["blender"])
        return
    with Alone():
        # Another make may have finished it while this one waited.
        if not is_current(read_stamp(folder), blender, groups, folder):
            bring_up(folder, blender, groups)


def parse(arguments):
    if not arguments:
        return "5.2"
    if len(arguments) == 2 and arguments[0] == "--blender":
        return arguments[1]
    fail("Usage: python3 tools/environment.py [--blender %s]" % " | ".join(PYTHON_OF))


def bring_up(folder, blender, groups):
    """Do what is missing of steps 1 to 4."""
    stamp = read_stamp(folder)
    if stamp is None or not is_installed(stamp, blender, groups, folder):
        wanted = blender
        blender, python = find_blender_and_python(wanted)
        if blender != wanted:
            say_fallback(wanted, blender)
        make_environment(folder, python, PYTHON_OF[blender])
        install(folder, requirements(groups, blender))
        stamp = {"blender": blender, "requirements": digest(requirements(groups, blender)), "libraries": False}
        write_stamp(folder, stamp)
    check_libraries(folder)
    stamp["libraries"] = True
    write_stamp(folder, stamp)


# ------------------------------------------------------------------------------------------------ what is wanted


def dependency_groups(text):
    """The table [dependency-groups] as {name: [requirement, …]}; Python has a TOML reader only from 3.11 on."""
    table = re.search(r"^\[dependency-groups\]\n(.*?)(?=^\[|\Z)", text, re.MULTILINE | re.DOTALL).group(1)
    entries = re.findall(r'^"?([\w.-]+)"? *= *\[(.*?)\]', table, re.MULTILINE | re.DOTALL)
    return {name: re.findall(r'"([^"]+)"', body) for name, body in entries}


def requirements(groups, blender):
    return groups["blender-" + blender] + groups["development"]


def digest(lines):
    return hashlib.sha256("\n".join(lines).encode()).hexdigest()


# ---------------------------------------------------------------------------------------------------- the stamp


STAMP = "candela-stamp.json"  # what is installed, and whether the system libraries were found
UNFINISHED = "candela-unfinished"  # stands while an installation runs: the environment may hold half of something


def read_stamp(folder):
    try:
        return json.loads((folder / STAMP).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None


def write_stamp(folder, stamp):
    new = folder / (STAMP + ".new")
    new.write_text(json.dumps(stamp), encoding="utf-8")
    new.replace(folder / STAMP)


def is_installed(stamp, blender, groups, folder):
    if stamp["blender"] not in (blender, FALLBACK_OF.get(blender)):
        return False
    # exists() follows the link to the Python that the environment was made with.
    return stamp["requirements"] == digest(requirements(groups, stamp["blender"])) and python_in(folder).exists()


def is_current(stamp, blender, groups, folder):
    return stamp is not None and stamp["libraries"] and is_installed(stamp, blender, groups, folder)


class Alone:
    """Only one process at a time makes environments; the lock goes with the process, however it ends."""

    def __enter__(self):
        self.file = Path(__file__).open("rb")
        try:
            import fcntl
        except ImportError:
            return
        try:
            fcntl.flock(self.file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            say("Waiting for another process that is making an environment.")
            fcntl.flock(self.file, fcntl.LOCK_EX)

    def __exit__(self, *_):
        self.file.close()


# ------------------------------------------------------------------------------------------------- 1: the Python


def find_blender_and_python(blender):
    """The Blender version that can be had, with the path of its Python."""
    for candidate in (blender, FALLBACK_OF.get(blender)):
        if candidate:
            python, obstacle = find_python(PYTHON_OF[candidate])
            if python:
                return candidate, python
            if obstacle:
                say(obstacle)
    wanted = PYTHON_OF[blender]
    fail(
        "Blender %s needs a Python %s, and none was found on PATH, in /usr/bin, or among those of pyenv and uv. "
        "On Debian: apt-get install python%s python%s-venv. With uv: uv python install %s."
        % (blender, wanted, wanted, wanted, wanted)
    )


# A free-threaded build loads no module that was built for the usual one, such as bpy.
VERSION_PROBE = """
import sys, sysconfig
print("%d.%d" % sys.version_info[:2], sysconfig.get_config_var("Py_GIL_DISABLED"))
"""


def say_fallback(wanted, blender):
    say(
        "Using Blender %s under Python %s, because Blender %s needs a Python %s and none was found; "
        "with one installed, delete %s and repeat."
        % (blender, PYTHON_OF[blender], wanted, PYTHON_OF[wanted], FOLDER_OF[wanted])
    )


def find_python(version):
    """The path of a Python of this version that runs and can make environments, or (None, sentence or None)."""
    obstacle = None
    for path in python_candidates(version):
        answer = answer_of([path, "-c", VERSION_PROBE])
        if not answer or answer.split()[0] != version or answer.split()[1] == "1":
            continue
        if answer_of([path, "-c", "import venv, ensurepip; print('yes')"]) == "yes":
            return path, None
        obstacle = "%s cannot make virtual environments; on Debian: apt-get install python%s-venv." % (path, version)
    return None, obstacle


def python_candidates(version):
    """Paths where a Python of this version may stand, the likeliest first, each once."""
    name = "python" + version
    pyenv = Path(os.environ.get("PYENV_ROOT", Path.home() / ".pyenv"))
    uv = Path(os.environ.get("UV_PYTHON_INSTALL_DIR", Path.home() / ".local" / "share" / "uv" / "python"))
    paths = [Path(folder, name) for folder in os.environ.get("PATH", "").split(os.pathsep) if folder]
    paths += newest_first(pyenv.glob("versions/" + version + ".*/bin/python"))
    paths += newest_first(uv.glob("cpython-" + version + "*/bin/" + name))
    paths += [Path(folder, name) for folder in ("/usr/bin", "/usr/local/bin", "/opt/homebrew/bin")]
    paths += [Path("/Library/Frameworks/Python.framework/Versions", version, "bin", "python3")]
    return [path for path in dict.fromkeys(paths) if os.access(str(path), os.X_OK)]


def newest_first(paths):
    return sorted(paths, key=lambda path: [int(number) for number in re.findall(r"\d+", str(path))], reverse=True)


def answer_of(command):
    """What a command prints, or None when it does not run: a shim of pyenv stands on PATH for versions that are off."""
    try:
        done = subprocess.run(
            [str(part) for part in command],
            check=False,
            timeout=30,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.decode(errors="replace").strip() if done.returncode == 0 else None


# ------------------------------------------------------------------------------- 2 and 3: the environment, the wheels


def python_in(folder):
    return folder / "Scripts" / "python.exe" if os.name == "nt" else folder / "bin" / "python"


def make_environment(folder, python, version):
    """A virtual environment with this Python; one that stands and is whole is kept."""
    probe = "import sys, pip; print('%d.%d' % sys.version_info[:2])"
    whole = not (folder / UNFINISHED).exists() and answer_of([python_in(folder), "-c", probe]) == version
    if not whole:
        say("Making %s with Python %s (%s)." % (folder.name, version, python))
        run([python, "-m", "venv", "--clear", folder], "The virtual environment %s could not be made." % folder)


def install(folder, wanted):
    say("Installing %s in %s; Blender is a download of about 370 MB." % (", ".join(wanted), folder.name))
    if (folder / STAMP).exists():
        (folder / STAMP).unlink()
    (folder / UNFINISHED).write_text("An installation was started here and has not ended.\n", encoding="utf-8")
    quiet = [] if sys.stdout.isatty() else ["--quiet"]
    command = [python_in(folder), "-m", "pip", "install", "--disable-pip-version-check", "--no-input"]
    run(command + quiet + wanted, "pip could not install the packages; its own words stand above.")
    (folder / UNFINISHED).unlink()


# ---------------------------------------------------------------------------------------------- 4: system libraries


def check_libraries(folder):
    """End with a sentence when Blender could not load here, or would find no OpenGL driver."""
    if not sys.platform.startswith("linux"):
        return
    missing = missing_libraries(folder)
    if missing:
        packages = sorted({PACKAGE_OF[name] for name in missing if name in PACKAGE_OF})
        unknown = sorted(name for name in missing if name not in PACKAGE_OF)
        sentences = ["Blender cannot load: the system lacks %s." % ", ".join(sorted(missing))]
        if packages:
            # Who lacks one of these has no OpenGL driver either.
            sentences.append("On Debian and its relatives: apt-get install %s" % " ".join(packages + DRIVER_PACKAGES))
        if unknown:
            sentences.append("Which package holds %s is not known here." % ", ".join(unknown))
        fail("\n".join(sentences))
    if answer_of([python_in(folder), "-c", EGL_PROBE]) != "yes":
        fail(
            "Blender would find no OpenGL driver on this machine: EGL cannot be initialised.\n"
            "On Debian and its relatives: apt-get install %s" % " ".join(DRIVER_PACKAGES)
        )


def missing_libraries(folder):
    """Names of shared libraries that neither the bpy wheel nor the system has."""
    find = "import importlib.util; print(importlib.util.find_spec('bpy').submodule_search_locations[0])"
    package = answer_of([python_in(folder), "-c", find])
    listing = answer_of(["ldd", Path(package, "__init__.so")]) if package else None
    missing = set(re.findall(r"^\s*(\S+) => not found", listing or "", re.MULTILINE))
    # Blender opens these by name when it makes a GPU context, so ldd does not list them.
    for name in ("libEGL.so.1", "libGL.so.1"):
        if answer_of([python_in(folder), "-c", "import ctypes; print(ctypes.CDLL('%s') and 'yes')" % name]) != "yes":
            missing.add(name)
    return missing


# Prints yes when one of EGL's ways to a display without a screen can be initialised: the default one, Mesa's
# surfaceless platform (0x31DD), or the device platform (0x313F) of a vendor's driver. Numbers from the EGL registry.
EGL_PROBE = """
import ctypes
egl = ctypes.CDLL("libEGL.so.1")
egl.eglGetProcAddress.restype = egl.eglGetDisplay.restype = ctypes.c_void_p
egl.eglGetDisplay.argtypes = [ctypes.c_void_p]
egl.eglInitialize.argtypes = [ctypes.c_void_p] * 3

def procedure(name, restype, *argtypes):
    address = egl.eglGetProcAddress(name)
    return ctypes.CFUNCTYPE(restype, *argtypes)(address) if address else None

displays = [egl.eglGetDisplay(None)]
platform_display = procedure(
    b"eglGetPlatformDisplayEXT", ctypes.c_void_p, ctypes.c_uint, ctypes.c_void_p, ctypes.c_void_p
)
query_devices = procedure(
    b"eglQueryDevicesEXT", ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.POINTER(ctypes.c_int)
)
if platform_display:
    displays.append(platform_display(0x31DD, None, None))
if platform_display and query_devices:
    devices, count = (ctypes.c_void_p * 8)(), ctypes.c_int()
    query_devices(8, devices, ctypes.byref(count))
    displays += [platform_display(0x313F, device, None) for device in devices[: count.value]]
if any(display and egl.eglInitialize(display, None, None) for display in displays):
    print("yes")
"""


# ------------------------------------------------------------------------------------------------------ small verbs


def run(command, sentence):
    try:
        code = subprocess.run([str(part) for part in command], check=False, stdin=subprocess.DEVNULL).returncode
    except OSError as error:
        fail("%s (%s)" % (sentence, error))
    if code != 0:
        fail(sentence)


def say(sentence):
    print(sentence, flush=True)


def fail(sentence):
    print(sentence, file=sys.stderr, flush=True)
    sys.exit(1)


if __name__ == "__main__":
    try:
        main(sys.argv[1:])
    except KeyboardInterrupt:
        fail("Interrupted; the next call goes on.")
