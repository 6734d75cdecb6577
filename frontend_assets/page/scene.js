// The scene: viser in an iframe of the same origin, its camera and its colours.

import { call } from "/assets/api.js";
import { byId, setText } from "/assets/dom.js";
import { isDark, onTheme } from "/assets/theme.js";

const ASK_MS = 400;

const frame = () => byId("scene");

/** Load the scene once the server has one to show; `onRelease()` when a mouse button comes up in it. */
export async function startScene(onRelease) {
  frame().addEventListener("load", () => {
    followTheme();
    watchReleases(onRelease);
  });
  onTheme(followTheme);
  for (;;) {
    const scene = await sceneWords();
    if (scene === "ready") break;
    setText(byId("stage-wait"), scene === "loading" ? "Loading the scene…" : scene);
    await new Promise((resolve) => setTimeout(resolve, ASK_MS));
  }
  frame().src = source();
}

async function sceneWords() {
  try {
    return (await call("GET", "/api/v1/health")).scene ?? "ready";
  } catch {
    return "loading";
  }
}

/** `?fixedDpr=` of the page is passed on: a coarser picture for slow machines. */
function source() {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  let address = `/viser/?websocket=${encodeURIComponent(`${scheme}://${location.host}/viser`)}&hideViserLogo`;
  const ratio = new URLSearchParams(location.search).get("fixedDpr");
  if (ratio !== null) address += `&fixedDpr=${encodeURIComponent(ratio)}`;
  if (isDark()) address += "&darkMode";
  return address;
}

/** Before the scene hears of it, which may not know any more that it held a gizmo. */
function watchReleases(onRelease) {
  for (const end of ["pointerup", "pointercancel"]) {
    sceneWindow()?.addEventListener(end, onRelease, { capture: true });
  }
}

/** The window of the scene, or null while it cannot be reached. */
export function sceneWindow() {
  try {
    const inner = frame().contentWindow;
    return inner?.document ? inner : null;
  } catch {
    return null;
  }
}

/**
 * Orientation of the view in the base frame, as (w, x, y, z): the view's x axis points right, y up,
 * z toward the person. Null while the scene has no camera.
 */
export function viewOrientation() {
  const mutable = sceneWindow()?.__viserMutable;
  const camera = mutable?.camera?.quaternion;
  if (!camera) return null;
  const root = rootOrientation(mutable);
  return multiply([root[0], -root[1], -root[2], -root[3]], [camera.w, camera.x, camera.y, camera.z]);
}

/** The scene's root is turned against three.js's world, whose y axis points up. */
function rootOrientation(mutable) {
  const root = mutable.nodeRefFromName?.[""]?.quaternion;
  if (root) return [root.w, root.x, root.y, root.z];
  return mutable.nodePoseData?.[""]?.wxyz ?? [0.5, -0.5, 0.5, 0.5];
}

function multiply([aw, ax, ay, az], [bw, bx, by, bz]) {
  return [
    aw * bw - ax * bx - ay * by - az * bz,
    aw * bx + ax * bw + ay * bz - az * by,
    aw * by - ax * bz + ay * bw + az * bx,
    aw * bz + ax * by - ay * bx + az * bw,
  ];
}

/** Change the scene's colours in place: loading it again would lose the camera. */
function followTheme() {
  const inner = sceneWindow()?.document;
  if (!inner?.documentElement) return;
  inner.documentElement.setAttribute("data-mantine-color-scheme", isDark() ? "dark" : "light");
  let behind = inner.querySelector("canvas");
  while (behind && !behind.style.backgroundColor) behind = behind.parentElement;
  if (behind) behind.style.backgroundColor = isDark() ? "#0d1015" : "#ffffff";
}
