#!/usr/bin/env bash
# SPDX-License-Identifier: GPL-3.0-or-later
#
# Makes the development environment in .venv: system libraries, uv, Python 3.13 and the packages pinned in
# requirements.txt. Does nothing when that is already so. Needs Debian or Ubuntu for the system libraries; on
# another Linux it says which are missing.
set -euo pipefail
shopt -s inherit_errexit
cd "$(dirname "${BASH_SOURCE[0]}")/.."

PYTHON_SERIES=3.13 # bpy 5.2 is built for this one and no other
VENV=.venv
TOOLS=.tools # uv, where the machine has none
STAMP=$VENV/.setup-stamp
PYTHON=$VENV/bin/python

say() { printf 'setup: %s\n' "$*"; }
die() {
  printf 'setup: %s\n' "$@" >&2
  exit 1
}

# --- system libraries -------------------------------------------------------------------------------------

# What the bpy wheel links to or loads at run time and does not bring along: soname, Debian package.
LIBRARIES='
libEGL.so.1 libegl1
libGL.so.1 libgl1
libX11.so.6 libx11-6
libXext.so.6 libxext6
libXrender.so.1 libxrender1
libXfixes.so.3 libxfixes3
libXi.so.6 libxi6
libXt.so.6 libxt6
libXxf86vm.so.1 libxxf86vm1
libSM.so.6 libsm6
libICE.so.6 libice6
libxkbcommon.so.0 libxkbcommon0
'

missing_libraries() {
  local known soname package
  known=$(PATH="$PATH:/sbin:/usr/sbin" ldconfig -p)
  while read -r soname package; do
    [ -z "$soname" ] || grep -qF "	$soname " <<<"$known" || echo "$package"
  done <<<"$LIBRARIES"
  # Mesa's drivers are opened by path, so the linker's cache does not list them.
  compgen -G '/usr/lib*/*/dri/swrast_dri.so' >/dev/null || compgen -G '/usr/lib*/dri/swrast_dri.so' >/dev/null ||
    echo libgl1-mesa-dri
}

# install_packages PACKAGE...: as root or with a sudo that asks for no password, else says what to run.
install_packages() {
  local sudo=() command="apt-get install -y --no-install-recommends $*"
  command -v apt-get >/dev/null ||
    die "these system libraries are missing, by their Debian names: $*" \
      "install them with this system's package manager, then run make setup again"
  if [ "$(id -u)" != 0 ]; then
    sudo -n true 2>/dev/null ||
      die "system packages are missing and need root. Run this line, then make setup again:" \
        "  sudo apt-get update && sudo $command"
    sudo=(sudo -n)
  fi
  say "installing system packages: $*"
  "${sudo[@]}" apt-get update -qq || say "apt-get update reported errors; going on with the lists there are"
  # shellcheck disable=SC2086 # the packages are separate words
  "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive $command -qq >/dev/null ||
    die "apt-get could not install: $*" "its own message is above"
}

# --- uv and Python ----------------------------------------------------------------------------------------

# A command may be on PATH and not work: pyenv's shims fail where the version that has the tool is not active.
find_uv() {
  local candidate
  for candidate in uv "$PWD/$TOOLS/bin/uv" "$HOME/.local/bin/uv"; do
    if "$candidate" --version >/dev/null 2>&1; then
      UV=$candidate
      return 0
    fi
  done
  return 1
}

# The system's Python that uv is installed with: any that runs and has pip, or can make an environment with pip.
find_installer() {
  local candidate
  for candidate in python3 "/usr/bin/python3" "python$PYTHON_SERIES"; do
    if "$candidate" -m pip --version >/dev/null 2>&1; then
      INSTALLER=("$candidate" -m pip install --target "$TOOLS")
      return 0
    elif "$candidate" -c 'import ensurepip, venv' >/dev/null 2>&1; then
      INSTALLER=("$candidate" -m venv "$TOOLS")
      return 0
    fi
  done
  return 1
}

install_uv() {
  find_installer || die "no Python here has pip or venv; install the package python3-venv"
  say "installing uv into $TOOLS"
  rm -rf "$TOOLS"
  if [ "${INSTALLER[2]}" = venv ]; then
    "${INSTALLER[@]}" || die "the environment in $TOOLS could not be made; the message is above"
    INSTALLER=("$TOOLS/bin/python" -m pip install)
  fi
  "${INSTALLER[@]}" -q --disable-pip-version-check --require-hashes -r requirements-uv.txt ||
    die "pip could not install uv; its own message is above"
  find_uv || die "uv was installed into $TOOLS and does not run"
}

# real_python COMMAND: the interpreter behind a command, if it runs and is of the right series. The base
# executable, so that an environment is never built on another one.
real_python() {
  "$1" -c "import sys; '%d.%d' % sys.version_info[:2] == '$PYTHON_SERIES' or sys.exit(1); print(sys._base_executable)" \
    2>/dev/null
}

find_python() {
  local candidate
  for candidate in "python$PYTHON_SERIES" "/usr/bin/python$PYTHON_SERIES" "/usr/local/bin/python$PYTHON_SERIES" \
    "${PYENV_ROOT:-$HOME/.pyenv}/versions/$PYTHON_SERIES".*/bin/"python$PYTHON_SERIES" python3; do
    BASE_PYTHON=$(real_python "$candidate") && return 0
  done
  BASE_PYTHON=$("$UV" python find --no-project --managed-python "$PYTHON_SERIES" 2>/dev/null)
}

install_python() {
  say "Python $PYTHON_SERIES was not found; installing it with uv"
  "$UV" python install "$PYTHON_SERIES" ||
    die "uv could not download Python $PYTHON_SERIES; its own message is above" \
      "install it by other means (a package python$PYTHON_SERIES as in Debian 13, or pyenv install $PYTHON_SERIES)," \
      "then run make setup again"
  find_python || die "uv installed Python $PYTHON_SERIES and cannot find it"
}

# --- environment ------------------------------------------------------------------------------------------

fingerprint() { { echo "$PWD"; cat requirements.txt scripts/setup.sh; } | sha256sum | cut -d' ' -f1; }

environment() {
  if ! real_python "$PYTHON" >/dev/null; then
    find_python || install_python
    say "making $VENV with $BASE_PYTHON"
    "$UV" venv -q --clear --no-project --python "$BASE_PYTHON" "$VENV"
  fi
  say "installing the packages of requirements.txt (bpy alone is 384 MB)"
  "$UV" pip sync --require-hashes --python "$PYTHON" requirements.txt ||
    die "the packages could not be installed; uv's own message is above"
}

# Blender in Python, and OpenGL without a display: the two things that a wrong machine fails at.
check() {
  local log
  log=$("$PYTHON" -c 'import bpy, gpu; gpu.init(); print(bpy.app.version_string, "on", gpu.platform.renderer_get())' \
    2>&1) || die "the environment is there, but Blender's OpenGL does not start in it:" "$log" \
    "if it says nothing clearer: apt-get install --reinstall libegl1 libegl-mesa0 libgl1-mesa-dri"
  say "Blender $(tail -n 1 <<<"$log")"
}

# Everything that needs root is asked for at once.
packages=
[ "$(uname -s)" != Linux ] || packages=$(missing_libraries)
if [ -z "$packages" ] && [ -x "$PYTHON" ] && [ "$(cat "$STAMP" 2>/dev/null)" = "$(fingerprint)" ] &&
  real_python "$PYTHON" >/dev/null; then
  exit 0
fi
find_uv || find_installer || packages+=" python3-venv"
# shellcheck disable=SC2086 # the packages are separate words
[ -z "$packages" ] || install_packages $packages

rm -f "$STAMP"
find_uv || install_uv
environment
check
fingerprint >"$STAMP"
