// Defines the element <gsac-avatar>; where there are no elements, as on a server, nothing happens.

import { GsacAvatar } from "./element.js";

if (globalThis.customElements && !customElements.get("gsac-avatar")) customElements.define("gsac-avatar", GsacAvatar);

export { GsacAvatar };
