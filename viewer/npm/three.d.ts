import { Mesh } from "three";

/** The avatar as an object of three.js, for its WebGLRenderer; one unit is a metre, and the feet stand at y = 0. */
export class GsacObject extends Mesh {
  /** @param bytes of avatar.gsac */
  constructor(bytes: ArrayBuffer);
  readonly clips: string[];
  readonly poses: string[];
  readonly expressions: string[];
  readonly joints: string[];
  /** Weights of the face, by name; taken over by the next update. */
  expression: Record<string, number>;
  /** Joint -> axis-angle, degrees, on top of what plays; taken over by the next update. */
  turned: Record<string, [number, number, number]>;
  /** Plays a motion or a pose by its name. */
  play(name: string): void;
  /** Goes on by some seconds. */
  update(seconds: number): void;
  dispose(): void;
}
