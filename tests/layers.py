"""The layer rule: lib <- solvers <- identify, third-party headers only where they belong."""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
MAY_INCLUDE = {
    "lib": ("lib/",),
    "solvers": ("lib/", "solvers/"),
    "identify": ("lib/", "solvers/", "identify/"),
}
# Headers of these libraries stay behind single files, so that the rest compiles fast and can do without them.
ONLY_IN = {
    r"ceres/": r"solvers/(ceres_backend\.cpp|sparse_least_squares\.cpp)",
    r"nlopt": r"solvers/nlopt_backend\.cpp",
    r"hwy/": r"lib/(simd_kernels|bank_kernel)\.cpp",
    r"CLI/": r"identify/command_(line|reference)\.cpp",
    r"nlohmann/": r"identify/(result_json|report_page|result_file|export_result)\.cpp",
    r"yaml-cpp/": r"identify/yaml_reader\.cpp",
    r"boost/": r"identify/distribution\.cpp",
    r"plplot/": r"identify/figure\.cpp",
    r"openssl/": r"identify/report\.cpp",
    r"fmt/": r"identify/.*\.cpp",
}
faults = []
for layer, allowed in MAY_INCLUDE.items():
    for path in sorted((ROOT / layer).glob("*.[hc]*")):
        name = path.relative_to(ROOT).as_posix()
        for number, line in enumerate(path.read_text().splitlines(), 1):
            include = re.match(r'\s*#\s*include\s*([<"])([^>"]+)[>"]', line)
            if not include:
                continue
            quoted, header = include.group(1) == '"', include.group(2)
            where = f"{name}:{number}: includes {header}"
            if quoted and not header.startswith(allowed):
                faults.append(f"{where}; a file of {layer} may include {', '.join(allowed)}")
            for pattern, only in ONLY_IN.items():
                if re.match(pattern, header) and not re.fullmatch(only, name):
                    faults.append(f"{where}; it belongs into {only} only")
print("\n".join(faults) or "layers hold")
sys.exit(bool(faults))
