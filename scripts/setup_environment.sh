#!/usr/bin/env bash
# Make the virtual environment .venv beside this folder with descentflow and the extras named as arguments.
set -euo pipefail
cd "$(dirname "$0")/.."
python="${PYTHON:-python3}"
"$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || {
    echo "descentflow needs Python 3.11 or later, and $python is $("$python" --version 2>&1); set PYTHON to a newer one" >&2
    exit 1
}
[ -x .venv/bin/python ] || "$python" -m venv .venv
case ",${1:-}," in
*,traffic,*)
    echo "setup_environment: the extra traffic wants pandas below 3, and .venv has constraints.txt with a later one:" \
        "it needs an environment of its own (docs/how-to/export_traffic.md):" \
        "python3 -m venv traffic_env && traffic_env/bin/pip install '.[traffic]'" >&2
    exit 1
    ;;
esac
extras="${1:+[$1]}"
# A stamp of what was installed spares the second run a minute of pip.
stamp=".venv/.installed-$(cat pyproject.toml constraints.txt | cksum | cut -d' ' -f1)-${1:-none}"
if [ ! -f "$stamp" ]; then
    .venv/bin/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e ".$extras"
    touch "$stamp"
fi
