"""What `advpipe` and `python -m advpipe` run.

Only the standard library is imported before signals have handlers: the command line's own imports take a
second, in which ctrl-C has to end the command in one line, too.
"""

from __future__ import annotations

import sys


def main() -> None:
    """Run the command line."""
    from advpipe.pipeline.core import signals, streams

    signals.install()
    streams.open_closed()
    try:
        from advpipe.pipeline.process.folder import leave_deleted_folder

        leave_deleted_folder()
        from advpipe.pipeline.cli import app

        app(prog_name="advpipe")
    except SystemExit:
        raise
    except BaseException as error:  # the command line itself cannot be loaded
        from advpipe.pipeline.process.failures import report_failure

        sys.exit(report_failure(error))
    finally:
        signals.uninstall()


if __name__ == "__main__":
    main()
