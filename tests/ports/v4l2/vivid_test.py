"""ports/v4l2 on a real kernel driver: vivid, in a virtual machine of another architecture.

    vivid_test.py GUEST KERNEL_FOLDER

GUEST: vivid_guest, cross-built and static. KERNEL_FOLDER: vmlinuz and modules, as scripts/setup
vivid leaves them; without them there is nothing to try, and the test is skipped. Packs both into an
initramfs, boots it under QEMU, and passes if the guest says that all of its checks passed. Nothing
of this machine is touched: no module is loaded here, and no /dev is looked at.
"""
import gzip
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

SKIPPED = 77
SECONDS = 500  # many times what it takes


def entry(name, content=b"", mode=0o100755, device=(0, 0)):
    """A file of a cpio archive, "newc" (Linux, buffer-format.rst)."""
    fields = [0, mode, 0, 0, 1, 0, len(content), 0, 0, *device, len(name) + 1, 0]
    head = b"070701" + b"".join(b"%08X" % field for field in fields) + name.encode() + b"\0"
    return head + b"\0" * (-len(head) % 4) + content + b"\0" * (-len(content) % 4)


def initramfs(guest, modules):
    parts = [entry("dev", mode=0o040755),
             entry("dev/console", mode=0o020600, device=(5, 1)),
             entry("modules", mode=0o040755), entry("init", guest.read_bytes())]
    parts += [entry(f"modules/{path.name}", path.read_bytes()) for path in modules.iterdir()]
    return gzip.compress(b"".join(parts) + entry("TRAILER!!!"), 1)


def main():
    guest, kernel = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    if not (kernel / "vmlinuz").exists() or not shutil.which("qemu-system-aarch64"):
        print("skipped: scripts/setup vivid brings the kernel and the machine")
        sys.exit(SKIPPED)
    with tempfile.TemporaryDirectory() as folder:
        disk = pathlib.Path(folder) / "initramfs"
        disk.write_bytes(initramfs(guest, kernel / "modules"))
        said = subprocess.run(
            ["qemu-system-aarch64", "-M", "virt", "-accel", "tcg", "-cpu", "cortex-a76",
             "-m", "512", "-display", "none", "-monitor", "none", "-serial", "stdio", "-no-reboot",
             "-nic", "none", "-kernel", str(kernel / "vmlinuz"), "-initrd", str(disk),
             "-append", "console=ttyAMA0 panic=-1 quiet"],
            stdin=subprocess.DEVNULL, capture_output=True, text=True, errors="replace",
            timeout=SECONDS).stdout
    print(said)
    found = re.search(r"RESULT passed (\d+) failed (\d+)", said)
    # So many that a guest which skipped half of them does not pass.
    if not found or int(found.group(1)) < 40 or int(found.group(2)) != 0:
        sys.exit("vivid_test: not all checks passed")


main()
