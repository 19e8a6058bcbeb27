"""Pictures of checkerboards by known cameras, and OpenCV's results for them.

    pip install "opencv-python-headless<5" numpy
    python boards.py

Writes, beside itself, a folder of JPEGs for each camera, and `boards.json`: the true camera and poses, the corners of OpenCV's
`findChessboardCorners` and `cornerSubPix`, and the results of `calibrateCameraExtended` (of `fisheye.calibrate` for the fisheye lens) on
those corners. Run with OpenCV 4.14.0 and NumPy 2.4.6.

Every pixel is the mean of 5 x 5 rays, traced through the inverse of the lens to the board's plane; then the optics' blur, noise, 8 bits
and JPEG. Pixel centres are at whole numbers.
"""

import json
from pathlib import Path

import cv2
import numpy as np

HERE = Path(__file__).resolve().parent
BOARD = (9, 6)
SQUARE = 0.025
MARGIN = 0.6 * SQUARE
RAYS = 5
BLUR_PX = 0.7
NOISE = 1.5
QUALITY = 78

CAMERAS = {
    "brown": {
        "model": "brown",
        "size": [400, 300],
        "k": [335.0, 332.5, 205.3, 145.8],
        "distortion": [-0.29, 0.11, 0.0012, -0.0009, -0.02],
        "views": 9,
        "seed": 3,
        "depth": [0.27, 0.42],
    },
    "plain": {
        "model": "brown",
        "size": [320, 240],
        "k": [290.0, 290.0, 161.2, 117.6],
        "distortion": [0.0, 0.0, 0.0, 0.0, 0.0],
        "views": 6,
        "seed": 11,
        "depth": [0.3, 0.4],
    },
    "fisheye": {
        "model": "fisheye",
        "size": [400, 300],
        "k": [158.0, 159.0, 203.0, 147.5],
        "distortion": [0.031, -0.012, 0.006, -0.0015],
        "views": 10,
        "seed": 5,
        "depth": [0.13, 0.21],
    },
}


def shown(camera, x, y):
    """Normalised image coordinates of the rays (x, y, 1)."""
    d = camera["distortion"]
    if camera["model"] == "fisheye":
        r = np.hypot(x, y)
        t = np.arctan(r)
        td = t * (1 + t**2 * (d[0] + t**2 * (d[1] + t**2 * (d[2] + t**2 * d[3]))))
        scale = np.where(r > 1e-9, td / np.maximum(r, 1e-9), 1.0)
        return x * scale, y * scale
    k1, k2, p1, p2, k3 = d
    r2 = x * x + y * y
    g = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return (
        g * x + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
        g * y + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
    )


def rays(camera, u, v):
    """The rays (x, y, 1) of pixels, by fixed-point iteration; as angles for the fisheye lens, so that wide rays stay finite."""
    fx, fy, cx, cy = camera["k"]
    sx, sy = (u - cx) / fx, (v - cy) / fy
    if camera["model"] == "fisheye":
        td = np.hypot(sx, sy)
        t = td.copy()
        d = camera["distortion"]
        for _ in range(50):
            t = td / (1 + t**2 * (d[0] + t**2 * (d[1] + t**2 * (d[2] + t**2 * d[3]))))
        s = np.where(td > 1e-9, np.sin(t) / np.maximum(td, 1e-9), 1.0)
        return np.stack([sx * s, sy * s, np.cos(t)], -1)
    x, y = sx.copy(), sy.copy()
    for _ in range(60):
        dx, dy = shown(camera, x, y)
        x, y = x - (dx - sx), y - (dy - sy)
    return np.stack([x, y, np.ones_like(x)], -1)


def picture(camera, rotation, translation, generator):
    width, height = camera["size"]
    offsets = (np.arange(RAYS) + 0.5) / RAYS - 0.5
    total = np.zeros((height, width))
    columns, rows = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
    normal = rotation[:, 2]
    for dv in offsets:
        for du in offsets:
            ray = rays(camera, columns + du, rows + dv)
            along = ray @ normal
            depth = (translation @ normal) / np.where(np.abs(along) > 1e-9, along, 1e-9)
            on_board = (ray * depth[..., None] - translation) @ rotation
            x, y = on_board[..., 0], on_board[..., 1]
            # The first inner corner is the origin; a board of 9 x 6 inner corners has 10 x 7 squares.
            column, row = np.floor(x / SQUARE) + 1, np.floor(y / SQUARE) + 1
            inside = (column >= 0) & (column <= BOARD[0]) & (row >= 0) & (row <= BOARD[1]) & (depth > 0)
            paper = (
                (x > -SQUARE - MARGIN)
                & (x < BOARD[0] * SQUARE + MARGIN)
                & (y > -SQUARE - MARGIN)
                & (y < BOARD[1] * SQUARE + MARGIN)
                & (depth > 0)
            )
            black = inside & ((column + row) % 2 == 0)
            # The background: a soft gradient, and a few stripes that also have corners.
            room = 90 + 40 * np.sin(columns / 37.0) + 25 * np.sin((rows + columns) / 23.0)
            total += np.where(black, 35.0, np.where(paper, 215.0, room))
    total /= RAYS * RAYS
    # Light falls off towards one side.
    total *= 0.85 + 0.15 * columns / width
    total = cv2.GaussianBlur(total, (0, 0), BLUR_PX)
    total += generator.normal(0, NOISE, total.shape)
    return np.clip(np.round(total), 0, 255).astype(np.uint8)


def board_points():
    columns, rows = np.meshgrid(np.arange(BOARD[0]), np.arange(BOARD[1]))
    return np.stack([columns.ravel() * SQUARE, rows.ravel() * SQUARE, np.zeros(columns.size)], -1)


def pixels(camera, rotation, translation):
    points = board_points() @ rotation.T + translation
    if np.any(points[:, 2] < 0.02):
        return None
    fx, fy, cx, cy = camera["k"]
    x, y = shown(camera, points[:, 0] / points[:, 2], points[:, 1] / points[:, 2])
    return np.stack([fx * x + cx, fy * y + cy], -1)


def poses(camera):
    """Poses, tilted in all directions and spread over the image, with the board and its margin inside the image."""
    generator = np.random.default_rng(camera["seed"])
    width, height = camera["size"]
    centre = np.array([(BOARD[0] - 1) / 2 * SQUARE, (BOARD[1] - 1) / 2 * SQUARE, 0])
    found, anchors = [], []
    goals = [(0.28, 0.3), (0.72, 0.3), (0.28, 0.7), (0.72, 0.7), (0.5, 0.5)]
    tries = 0
    while len(found) < camera["views"]:
        tries += 1
        goal = goals[len(found) % len(goals)]
        tilt = generator.uniform(10, 45) * np.array([generator.choice([-1, 1]), generator.choice([-1, 1])])
        roll = generator.uniform(-25, 25)
        turn = np.deg2rad([tilt[0] * generator.uniform(0.2, 1), tilt[1] * generator.uniform(0.2, 1), roll])
        rotation = cv2.Rodrigues(turn)[0]
        middle = np.array([goal[0] * width, goal[1] * height]) + generator.normal(0, 12, 2)
        ray = rays(camera, middle[:1], middle[1:])[0]
        depth = generator.uniform(*camera["depth"])
        translation = ray / np.linalg.norm(ray) * depth - rotation @ centre
        seen = pixels(camera, rotation, translation)
        if seen is None:
            continue
        edge = 9
        if seen.min() < edge or seen[:, 0].max() > width - edge or seen[:, 1].max() > height - edge:
            continue
        grid = seen.reshape(BOARD[1], BOARD[0], 2)
        steps = [np.linalg.norm(np.diff(grid, axis=a), axis=-1).min() for a in (0, 1)]
        if min(steps) < 11:
            continue
        found.append((rotation, translation))
    return found


def calibrated(camera, corners):
    size = tuple(camera["size"])
    objects = [board_points().astype(np.float32).reshape(-1, 1, 3) for _ in corners]
    images = [np.array(c, np.float32).reshape(-1, 1, 2) for c in corners]
    if camera["model"] == "fisheye":
        flags = cv2.fisheye.CALIB_RECOMPUTE_EXTRINSIC | cv2.fisheye.CALIB_FIX_SKEW
        criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 200, 1e-12)
        rms, k, d, _, _ = cv2.fisheye.calibrate(
            [o.astype(np.float64) for o in objects],
            [i.astype(np.float64) for i in images],
            size,
            np.eye(3),
            np.zeros((4, 1)),
            flags=flags,
            criteria=criteria,
        )
        errors = None
    else:
        criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 200, 1e-14)
        rms, k, d, _, _, errors, _, _ = cv2.calibrateCameraExtended(
            objects, images, size, None, None, criteria=criteria
        )
        errors = [float(e) for e in errors.ravel()[:9]]
    return {
        "rms": float(rms),
        "k": [float(k[0, 0]), float(k[1, 1]), float(k[0, 2]), float(k[1, 2])],
        "distortion": [float(c) for c in d.ravel()[: len(camera["distortion"])]],
        # Standard deviations of fx, fy, cx, cy, k1, k2, p1, p2, k3.
        "standard_errors": errors,
    }


def main():
    fixture = {"board": list(BOARD), "square": SQUARE, "opencv": cv2.__version__, "cameras": {}}
    for name, camera in CAMERAS.items():
        folder = HERE / name
        folder.mkdir(exist_ok=True)
        for old in folder.glob("*.jpg"):
            old.unlink()
        generator = np.random.default_rng(camera["seed"] + 100)
        views, corners = [], []
        for number, (rotation, translation) in enumerate(poses(camera)):
            file = f"{name}/{number:02}.jpg"
            path = str(HERE / file)
            cv2.imwrite(path, picture(camera, rotation, translation, generator), [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
            grey = cv2.imread(path, cv2.IMREAD_GRAYSCALE)
            ok, seen = cv2.findChessboardCorners(grey, BOARD)
            truth = pixels(camera, rotation, translation)
            view = {"file": file, "truth": np.round(truth, 3).tolist(), "corners": None}
            if ok:
                criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 100, 1e-4)
                seen = cv2.cornerSubPix(grey, seen, (4, 4), (-1, -1), criteria).reshape(-1, 2)
                # OpenCV may start at the opposite corner.
                if np.abs(seen - truth).max() > 3:
                    seen = seen[::-1]
                print(file, "corners off by", np.linalg.norm(seen - truth, axis=1).max().round(3), "px at most")
                view["corners"] = np.round(seen.astype(float), 3).tolist()
                corners.append(seen)
            else:
                print(file, "OpenCV finds no board")
            views.append(view)
        about = {key: camera[key] for key in ("model", "size", "k", "distortion")}
        about["views"] = views
        about["opencv"] = calibrated(camera, corners)
        print(name, about["opencv"])
        fixture["cameras"][name] = about
    (HERE / "boards.json").write_text(json.dumps(fixture) + "\n")


if __name__ == "__main__":
    main()
