/** What of the avatar is seen: attributes of the element, of the same names as the options in the viewer page's address. */
export interface GsacAvatarEventMap {
  load: CustomEvent<{ clips: string[]; poses: string[]; expressions: string[]; joints: string[] }>;
  error: CustomEvent<string>;
  note: CustomEvent<string>;
  change: CustomEvent<null>;
  pick: CustomEvent<{ joint: string }>;
  end: CustomEvent<null>;
  rate: CustomEvent<{ fps: number; p95: number }>;
}

/** Networks of @mediapipe/tasks-vision in running mode VIDEO; the face's with blendshapes and transformation matrixes. */
export interface MirrorKit {
  face?: unknown;
  pose?: unknown;
}

export class GsacAvatar extends HTMLElement {
  readonly clips: string[];
  readonly poses: string[];
  readonly expressions: string[];
  readonly joints: string[];
  readonly duration: number;
  readonly paused: boolean;
  /** What is seen, as the words after # of the viewer page's address. */
  readonly view: string;
  /** The bytes of avatar.gsac, once it is there. */
  readonly file: ArrayBuffer | null;
  currentTime: number;
  /** Fetches avatar.gsac from an address and shows it, as the attribute src does. */
  load(address: string): Promise<void>;
  /** Shows an avatar from the bytes of its file. */
  open(bytes: ArrayBuffer): Promise<void>;
  /** Plays a motion or a pose by its name; without one goes on after a pause. */
  play(name?: string): void;
  pause(): void;
  toggle(): void;
  /** Weights of the face, by expression; what is not named is at rest. */
  express(weights: Record<string, number>): void;
  /** Joint -> axis-angle, degrees, on top of what plays; what is not named is not turned. */
  turn(turns: Record<string, [number, number, number]>): void;
  /** The camera glides to "body", "face" or a joint. */
  look(what: string): void;
  reset(): void;
  /** What is seen, as PNG. */
  picture(): Promise<Blob>;
  /** What is seen for so long, by default once through the motion or around the figure in a pose, as WebM or MP4. */
  film(seconds?: number): Promise<Blob>;
  /** The avatar does what the user does before the camera, until it is called with null. */
  mirror(kit: MirrorKit | null): Promise<void>;
  fullscreen(): void;
  addEventListener<K extends keyof GsacAvatarEventMap>(type: K, listener: (event: GsacAvatarEventMap[K]) => void,
    options?: boolean | AddEventListenerOptions): void;
  addEventListener(type: string, listener: EventListenerOrEventListenerObject, options?: boolean | AddEventListenerOptions): void;
}

declare global {
  interface HTMLElementTagNameMap {
    "gsac-avatar": GsacAvatar;
  }
}
