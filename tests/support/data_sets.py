"""Data sets of a few frames in the layouts that they are given out in."""

import json
import pickle
import subprocess

import cv2
import numpy as np

from gsac.avatar.ffmpeg import ffmpeg_program

SIZE = 48, 64
FOCAL, CENTER = 90.0, (24.0, 32.0)


def picture(t):
    """(64, 48, 3) uint8, another grey in each frame, red at the left; its mask (64, 48) bool moves."""
    image = np.full((SIZE[1], SIZE[0], 3), 20 + 3 * (t % 60), np.uint8)
    image[:, :8] = (250, 10, 10)
    mask = np.zeros(image.shape[:2], bool)
    mask[16:48, 12 + t % 8: 30 + t % 8] = True
    return image, mask


def write_video(path, frames):
    pipe = subprocess.run([ffmpeg_program(), "-v", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{SIZE[0]}x{SIZE[1]}",
                           "-r", "30", "-i", "-", "-c:v", "libx264", "-qp", "0", "-pix_fmt", "yuv444p", str(path)],
                          input=b"".join(picture(t)[0].tobytes() for t in range(frames)), capture_output=True)
    assert pipe.returncode == 0, pipe.stderr


def peoplesnapshot(root, subject="female-4-casual", frames=350, protocol=2):
    import h5py

    folder = root / subject
    folder.mkdir(parents=True)
    write_video(folder / f"{subject}.mp4", frames)
    with h5py.File(folder / "masks.hdf5", "w") as file:
        file["masks"] = np.stack([picture(t)[1] for t in range(frames)]).astype(np.uint8)
    with h5py.File(folder / "reconstructed_poses.hdf5", "w") as file:
        file["pose"], file["trans"] = np.arange(frames)[:, None] * np.ones(72), np.ones((frames, 3))
        file["betas"] = np.arange(10.0)
    camera = {"camera_f": np.array([FOCAL, FOCAL]), "camera_c": np.array(CENTER), "camera_k": np.zeros(5),
              "camera_t": np.zeros(3), "camera_rt": np.zeros(3), "width": SIZE[0], "height": SIZE[1]}
    (folder / "camera.pkl").write_bytes(pickle.dumps(camera, protocol))
    return folder


def xhumans(root, subject="00099", takes=(("train", "Take1", 3), ("train", "Take2", 2), ("test", "Take3", 2))):
    folder = root / subject
    turn = cv2.Rodrigues(np.array([0, 0.3, 0]))[0]
    for part, take, frames in takes:
        at = folder / part / take
        for name in ("render/image", "render/depth", "SMPLX"):
            (at / name).mkdir(parents=True)
        for t in range(1, frames + 1):
            image, mask = picture(t)
            cv2.imwrite(str(at / f"render/image/color_{t:06d}.png"), image[..., ::-1])
            cv2.imwrite(str(at / f"render/depth/depth_{t:06d}.tiff"), np.where(mask, 2.0, 10.0).astype(np.float32))
            pose = {"global_orient": np.zeros(3, np.float32), "body_pose": np.full(63, t, np.float32), "transl": np.ones(3),
                    "left_hand_pose": np.zeros(45), "right_hand_pose": np.zeros(45), "betas": np.zeros(10),
                    **{name: np.zeros(3) for name in ("jaw_pose", "leye_pose", "reye_pose")}}
            (at / f"SMPLX/mesh-f{t:05d}_smplx.pkl").write_bytes(pickle.dumps(pose))
        np.savez(at / "render/cameras.npz", intrinsic=np.array([[FOCAL, 0, 24], [0, FOCAL, 32], [0, 0, 1]]),
                 extrinsic=np.tile(np.column_stack([turn, [0, 0, 3]]), (frames, 1, 1)))
    return folder


def neuman(root, scene="bike", frames=6, test=(4,)):
    folder = root / scene
    for name in ("images", "segmentations", "sparse"):
        (folder / name).mkdir(parents=True)
    lines = ["# a comment"]
    for t in range(frames):
        image, mask = picture(t)
        cv2.imwrite(str(folder / f"images/{t:05d}.png"), image[..., ::-1])
        cv2.imwrite(str(folder / f"segmentations/{t:05d}.png"), np.where(mask, 0, 255).astype(np.uint8))
        lines += [f"{t + 1} {np.sqrt(0.5)} 0 {np.sqrt(0.5)} 0 0.5 0 {t} 1 {t:05d}.png", "1.0 2.0 -1"]
    (folder / "sparse/images.txt").write_text("\n".join(lines) + "\n")
    (folder / "sparse/cameras.txt").write_text(f"# one\n1 PINHOLE {SIZE[0]} {SIZE[1]} {FOCAL} {FOCAL} 24 32\n")
    for part, numbers in {"train": [t for t in range(frames) if t not in (*test, 5)], "val": [5], "test": test}.items():
        (folder / f"{part}_split.txt").write_text("".join(f"{t:05d}.png\n" for t in numbers))
    return folder


def plain_folder(root, name="mine", frames=5, test=("frame_0004",)):
    folder = root / name
    for part in ("images", "masks"):
        (folder / part).mkdir(parents=True)
    for t in range(frames):
        image, mask = picture(t)
        cv2.imwrite(str(folder / f"images/frame_{t:04d}.png"), image[..., ::-1])
        cv2.imwrite(str(folder / f"masks/frame_{t:04d}.png"), mask.astype(np.uint8) * 255)
    (folder / "test_split.txt").write_text("\n".join(test))
    return folder


def read_json(path):
    return json.loads(path.read_text())
