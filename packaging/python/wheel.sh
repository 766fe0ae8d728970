#!/usr/bin/env bash
# Makes a wheel in dist/ of what is installed here, without network: packaging/python/wheel.sh [PYTHON]
set -euo pipefail
cd "$(dirname "$0")/../.."
"${1-/usr/bin/python3}" -m pip wheel --no-index --no-build-isolation --no-deps -w dist .
