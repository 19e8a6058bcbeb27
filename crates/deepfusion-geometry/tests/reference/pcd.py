"""The fixture of src/pcd.rs, by somebody else's writer: pip install pypcd4; python pcd.py"""

import numpy as np
from pypcd4 import PointCloud

columns = [
    np.array([1.0, 0.0], np.float32),
    np.array([-2.5, 0.5], np.float32),
    np.array([3.25, 40.0], np.float32),
    PointCloud.encode_rgb(np.array([[255, 128, 1], [2, 3, 4]], np.uint8)),
    np.array([0.5, 0.25], np.float32),
]
names = ("x", "y", "z", "rgb", "confidence")
PointCloud.from_points(columns, names, (np.float32,) * 5).save("cloud.pcd")
