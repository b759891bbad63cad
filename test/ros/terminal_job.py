"""
A shell of one job, run as a program: `terminal_job.py TERMINAL COMMAND...` starts the command as a background job.

Lines on stdin: `fg` brings it to the foreground of the terminal, `bg` lets it go on in the background, both by SIGCONT;
`watch` waits until it stops or ends, takes the terminal back, and prints `stopped` or `ended CODE`.
"""
from contextlib import suppress
import os
import signal
import sys

terminal = os.open(sys.argv[1], os.O_RDWR)   # of a session without a terminal: it becomes that of this session
signal.signal(signal.SIGTTOU, signal.SIG_IGN)
job = os.fork()
if job == 0:
    os.setpgid(0, 0)
    signal.signal(signal.SIGTTOU, signal.SIG_DFL)
    os.dup2(terminal, 0)
    os.execv(sys.argv[2], sys.argv[2:])
with suppress(PermissionError):   # it has done so itself already, and is another program now
    os.setpgid(job, job)
print(f'job {job}', flush=True)
for line in sys.stdin:
    if line == 'fg\n':
        os.tcsetpgrp(terminal, job)
    if line in ('fg\n', 'bg\n'):
        os.killpg(job, signal.SIGCONT)
        continue
    _, status = os.waitpid(job, os.WUNTRACED)
    os.tcsetpgrp(terminal, os.getpgrp())
    print('stopped' if os.WIFSTOPPED(status) else f'ended {os.waitstatus_to_exitcode(status)}', flush=True)
