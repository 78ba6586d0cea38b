"""``python -m calib`` is the program ``calib``."""

import sys

from calib._program import main

sys.exit(main())
