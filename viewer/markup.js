// What stands inside of the element <gsac-avatar>: its style, its stage and its bar of controls.

const STYLE = `
:host { display: block; position: relative; width: 300px; height: 400px; overflow: hidden; contain: content; color-scheme: dark;
  background: #2b303b; color: #f2f4f8; font: 14px/1.3 system-ui, -apple-system, "Segoe UI", Roboto, sans-serif; }
[hidden] { display: none !important; }
#stage { position: absolute; inset: 0; cursor: grab; outline: none; touch-action: pan-y; }
:host([gestures="all"]) #stage { touch-action: none; }
#stage:active { cursor: grabbing; }
#stage:focus-visible::after { content: ""; position: absolute; inset: 2px; border: 2px solid #6ea8fe; border-radius: 6px;
  pointer-events: none; }
#stage canvas { width: 100%; height: 100%; display: block; }
#poster { position: absolute; inset: 0; width: 100%; height: 100%; object-fit: contain; }
#message { position: absolute; inset: 0; margin: 0; display: grid; place-items: center; padding: 16px; text-align: center; }
#bar { position: absolute; left: 6px; right: 6px; bottom: 6px; display: flex; align-items: center; gap: 4px; padding: 3px;
  border-radius: 12px; background: rgba(20, 24, 32, .85); }
button, select { min-height: 36px; min-width: 36px; padding: 0 8px; border: 0; border-radius: 9px; background: transparent;
  color: inherit; font: inherit; cursor: pointer; }
button:hover, select:hover { background: rgba(255, 255, 255, .09); }
button[aria-pressed="true"] { background: #6ea8fe; color: #0b1320; }
select { flex: 0 1 120px; min-width: 60px; } select option { background: #20242c; }
input { flex: 1 1 60px; min-width: 40px; height: 36px; margin: 0; accent-color: #6ea8fe; }
svg { width: 15px; vertical-align: -2px; fill: none; stroke: currentColor; stroke-width: 1.7; }
:focus-visible { outline: 2px solid #6ea8fe; outline-offset: 1px; }
`;

export const MARKUP = `<style>${STYLE}</style>
<div id="stage" role="application" tabindex="0"
  aria-label="The avatar. Drag or arrow keys turn it; scroll or pinch comes nearer."><canvas></canvas></div>
<img id="poster" alt="" hidden>
<p id="message" role="status" hidden></p>
<div id="bar" part="bar" role="group" aria-label="Avatar" hidden>
  <button id="toggle">Play</button>
  <select id="motion" aria-label="Pose or motion"></select>
  <input id="time" type="range" min="0" max="1" step="any" value="0" aria-label="Place in the motion">
  <button id="face" aria-pressed="false">Face</button>
  <button id="full" aria-label="Full screen"><svg
    viewBox="0 0 16 16" aria-hidden="true"><path d="M2 6V2h4M10 2h4v4M14 10v4h-4M6 14H2v-4"/></svg></button>
</div>`;
