// Called in the page by test_page.py: what a person would call broken about the layout, in words.
() => {
  const SLACK_PX = 1.5;
  const OVERLAP_PX = 3;
  const faults = [];
  // A colour on its way to another one is nobody's choice.
  document.getAnimations().forEach((animation) => animation.finish());

  const words = (element) => {
    const text = (element.getAttribute("aria-label") ?? element.textContent).trim().replace(/\s+/g, " ");
    return `${element.tagName.toLowerCase()}${element.id ? `#${element.id}` : ""} “${text.slice(0, 40)}”`;
  };
  const isShown = (element) =>
    element.checkVisibility({ opacityProperty: true, visibilityProperty: true, contentVisibilityAuto: true });
  const shared = (a, b) => ({
    left: Math.max(a.left, b.left),
    top: Math.max(a.top, b.top),
    right: Math.min(a.right, b.right),
    bottom: Math.min(a.bottom, b.bottom),
  });
  const isEmpty = (box) => box.right - box.left < 1 || box.bottom - box.top < 1;
  const screen = { left: 0, top: 0, right: innerWidth, bottom: innerHeight };

  const remembered = (find) => {
    const known = new Map();
    return (key) => {
      if (!known.has(key)) known.set(key, find(key));
      return known.get(key);
    };
  };
  /** What is on the screen of the inside of `element`, after every ancestor has cut off its share. */
  const windowOf = remembered((element) => {
    if (element === null) return screen;
    const outer = windowOf(element.parentElement);
    const cuts = getComputedStyle(element).overflow !== "visible";
    return cuts ? shared(outer, element.getBoundingClientRect()) : outer;
  });

  const seenOf = (element, box) => shared(box, windowOf(element.parentElement));
  const scrolls = (element) => element.closest(".left-scroll, .numbers, .drawer-scroll, dialog") !== null;
  const cutsOnPurpose = (element) => {
    const style = getComputedStyle(element);
    return style.textOverflow === "ellipsis" || style.webkitLineClamp !== "none";
  };

  const texts = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const element = walker.currentNode.parentElement;
    if (!walker.currentNode.data.trim() || !isShown(element)) continue;
    if (["SCRIPT", "STYLE", "OPTION", "TITLE"].includes(element.tagName)) continue;
    const range = document.createRange();
    range.selectNodeContents(walker.currentNode);
    const box = range.getBoundingClientRect();
    texts.push({ element, box, seen: shared(box, windowOf(element)) });
  }

  const insideOf = (box, outer) =>
    box.left >= outer.left - SLACK_PX && box.right <= outer.right + SLACK_PX &&
    box.top >= outer.top - SLACK_PX && box.bottom <= outer.bottom + SLACK_PX;

  const cutText = () => {
    for (const { element, box, seen } of texts) {
      if (cutsOnPurpose(element) || element.closest(".toast, .banner")) continue;
      if (box.left < seen.left - SLACK_PX || box.right > seen.right + SLACK_PX) {
        if (!scrolls(element) || !isEmpty(seen)) faults.push(`cut at a side: ${words(element)}`);
      }
      if (!scrolls(element) && !insideOf(box, seen)) faults.push(`cut: ${words(element)}`);
      const button = element.closest("button, .segment, .drop, .chip");
      if (button && !insideOf(box, button.getBoundingClientRect())) {
        faults.push(`wider than its button: ${words(element)}`);
      }
    }
  };

  const isOver = (element) => element.closest(".stack, .tooltip, .lost, [popover], dialog") !== null;
  const overlappingText = () => {
    const level = texts.filter(({ element, seen }) => !isOver(element) && !isEmpty(seen));
    level.forEach((one, index) => {
      for (const other of level.slice(index + 1)) {
        if (one.element === other.element) continue;
        const common = shared(one.seen, other.seen);
        if (common.right - common.left > OVERLAP_PX && common.bottom - common.top > OVERLAP_PX) {
          faults.push(`overlap: ${words(one.element)} and ${words(other.element)}`);
        }
      }
    });
  };

  const controls = [...document.querySelectorAll("button, input, select, summary, a, canvas, iframe")];
  const hiddenControls = () => {
    for (const control of controls) {
      if (!control.checkVisibility({ visibilityProperty: true })) continue;
      const box = control.getBoundingClientRect();
      const seen = seenOf(control, box);
      if (!scrolls(control) && !insideOf(box, seen)) faults.push(`not whole on the screen: ${words(control)}`);
      if (isEmpty(seen)) continue;
      if (box.width < 12 || box.height < 10) faults.push(`too small: ${words(control)}`);
      const hit = document.elementFromPoint((seen.left + seen.right) / 2, (seen.top + seen.bottom) / 2);
      const mine = hit === control || control.contains(hit) || control.labels?.[0]?.contains(hit);
      // A message or the help may cover anything but the emergency stop.
      const mayBe = hit && isOver(hit) && control.id !== "emergency-stop";
      if (!mine && !mayBe) {
        faults.push(`covered: ${words(control)} by ${hit ? words(hit) : "nothing"}`);
      }
    }
  };

  const canvas = document.createElement("canvas").getContext("2d", { willReadFrequently: true });
  /** Any CSS colour as [red, green, blue, alpha] of 0 to 255, as the browser paints it. */
  const painted = remembered((colour) => {
    canvas.clearRect(0, 0, 1, 1);
    canvas.fillStyle = colour;
    canvas.fillRect(0, 0, 1, 1);
    return [...canvas.getImageData(0, 0, 1, 1).data];
  });
  const over = (top, below) => top.slice(0, 3).map((c, i) => (c * top[3] + below[i] * (255 - top[3])) / 255);
  const behind = (element) => {
    const layers = [];
    for (let one = element; one; one = one.parentElement) {
      layers.push(painted(getComputedStyle(one).backgroundColor));
      if (layers.at(-1)[3] === 255) break;
    }
    return layers.reverse().reduce((below, top) => over(top, below), [255, 255, 255]);
  };
  const luminance = (rgb) => {
    const [r, g, b] = rgb.map((c) => (c / 255 <= 0.04045 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4));
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const paleText = () => {
    for (const { element, seen } of texts) {
      if (isEmpty(seen)) continue;
      const ground = behind(element);
      const ink = over(painted(getComputedStyle(element).color), ground);
      const [dark, light] = [luminance(ink), luminance(ground)].sort((a, b) => a - b);
      const contrast = (light + 0.05) / (dark + 0.05);
      if (contrast < 4.5) faults.push(`contrast ${contrast.toFixed(1)}: ${words(element)}`);
    }
  };

  if (document.documentElement.scrollWidth > innerWidth) faults.push("the page scrolls sideways");
  if (document.documentElement.scrollHeight > innerHeight) faults.push("the page scrolls");
  for (const pane of document.querySelectorAll(".left-scroll, .numbers, .drawer-scroll")) {
    if (pane.scrollWidth > pane.clientWidth) faults.push(`scrolls sideways: .${pane.className}`);
  }
  cutText();
  overlappingText();
  hiddenControls();
  paleText();
  return [...new Set(faults)];
}
