"""Peak of the resident memory."""

import resource


def peak_mib():
    # Where there is no /proc: on Linux this one counts what the parent had when it started this process.
    try:
        with open("/proc/self/status") as status:
            lines = dict(line.split(":", 1) for line in status)
        return int(lines["VmHWM"].split()[0]) / 1024.0
    except (OSError, KeyError):
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
