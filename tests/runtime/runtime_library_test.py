"""The linked device library asks the system for memory and little else, and stays small. Called with the library's path."""
import re
import subprocess
import sys
import tempfile

LIMIT_BYTES = 400_000  # stripped, XNNPACK not counted
ALLOWED_LIBRARIES = r"lib(XNNPACK|pthreadpool|stdc\+\+|m|gcc_s|c)\.so|ld-linux"
FORBIDDEN = {
    "LibTorch": r"torch|c10",
    "exception": r"__cxa_(throw|rethrow|allocate_exception|begin_catch)",
    "file": r"^(fopen|fdopen|open|openat|read|pread|write|mmap|stat|fstat|rename|unlink)(64)?(@|$)",
    "clock": r"^(clock_gettime|gettimeofday|time|nanosleep)(@|$)|chrono",
    "environment": r"^(getenv|secure_getenv|system|fork|dlopen)(@|$)",
}


def output(*command):
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout


def main(library):
    findings = []
    symbols = [line.split(maxsplit=1)[1] for line in output("nm", "-DC", "--undefined-only", library).splitlines()]
    for why, pattern in FORBIDDEN.items():
        findings += [f"{why}: {symbol}" for symbol in symbols if re.search(pattern, symbol)]
    needed = re.findall(r"\(NEEDED\).*\[(.*)\]", output("readelf", "-d", library))
    findings += [f"links {name}" for name in needed if not re.match(ALLOWED_LIBRARIES, name)]
    with tempfile.NamedTemporaryFile() as stripped:
        subprocess.run(["strip", "-o", stripped.name, library], check=True)
        with open(stripped.name, "rb") as file:
            size = len(file.read())
    if not symbols or not needed:
        findings.append("the library has no imports: the check sees nothing")
    if size > LIMIT_BYTES:
        findings.append(f"{size} bytes stripped, at most {LIMIT_BYTES}")
    for finding in findings:
        print(f"{library}: {finding}")
    print(f"runtime library, package reader included, without XNNPACK: {size} bytes stripped, {len(symbols)} imported symbols")
    return 1 if findings else 0


sys.exit(main(sys.argv[1]))
