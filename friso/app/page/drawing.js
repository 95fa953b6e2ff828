// The machine as a drawing whose parts are chosen by mouse and keyboard.
import { svg } from "./dom.js";

/** Parts, the tables of the stage file that each is about, and how it is drawn: see `bodies`. */
export const PARTS = [
  { id: "motion", label: "Motion", tables: ["motion"] },
  { id: "controller", label: "Controller", tables: ["controller"] },
  { id: "actuator", label: "Actuator and drive", tables: ["actuator", "transmission", "motor_friction", "drive"] },
  { id: "encoder", label: "Encoder", tables: ["encoder", "drive"] },
  { id: "cart", label: "Cart", tables: ["masses", "bias"] },
  { id: "joint", label: "Joint and limiter", tables: ["joint", "parasitic"] },
  { id: "leaves", label: "Leaf springs", tables: ["flexure"] },
  { id: "stage", label: "Stage", tables: ["masses", "bias", "cable"] },
  { id: "friction", label: "Bearing and rail", tables: ["friction", "rail", "floor"] },
];

const box = (x, y, width, height, more = {}) => svg("rect", { class: "body", x, y, width, height, rx: 3, ...more });
const hit = (x, y, width, height) => svg("rect", { class: "hit", x, y, width, height, rx: 5 });
const line = (d, kind = "wire", more = {}) => svg("path", { class: kind, d, ...more });
const text = (x, y, words, kind = "") => svg("text", { x, y, class: kind }, words);
const disc = (cx) => svg("circle", { class: "body", cx, cy: 171, r: 43 });
const head = (x, y, turn) => svg("path", { class: "wire", d: "M -6 -3.5 L 0 0 L -6 3.5", transform: `translate(${x} ${y}) rotate(${turn})` });

/** The drawing of a machine as the server describes it; `choose` is called with a part, `lock` with true or false. */
export function drawing(machine, chosen, choose, lock) {
  const tables = new Map(machine.tables.map((table) => [table.name, table]));
  const value = (path) => tables.get(path.split(".")[0])?.keys.find((key) => key.path === path)?.value;
  const joint = tables.get("joint")?.present;
  const two = value("masses.cart") !== undefined && value("masses.cart") !== null && value("masses.stage") != null;
  const image = svg("svg", { viewBox: "0 0 480 262", role: "group", "aria-label": "Parts of the machine" });
  const shapes = bodies(machine.axis === "rotary", joint, two, value);
  const driven = tables.get("transmission")?.present;
  if (driven) transmission(shapes, value);
  const moved = driven ? `translate(${machine.axis === "rotary" ? -19 : -56} 0)` : null;
  for (const part of PARTS) {
    if (!shapes[part.id]) continue;
    const group = svg("g", {
      class: `part ${part.id}${part.id === chosen ? " chosen" : ""}`,
      tabindex: 0,
      role: "button",
      "aria-label": part.label,
      "aria-pressed": String(part.id === chosen),
      id: `part-${part.id}`,
      "data-part": part.id,
      transform: BESIDE_MOTOR.includes(part.id) ? moved : null,
      onclick: () => choose(part.id),
      onkeydown: (event) => {
        if (event.key !== "Enter" && event.key !== " ") return;
        event.preventDefault();
        choose(part.id);
      },
    });
    group.append(...shapes[part.id]);
    image.append(group);
  }
  if (joint) image.append(lockSwitch(value("joint.locked") === true, lock, moved));
  return image;
}

function bodies(rotary, joint, two, value) {
  const mass = (name) => value(`masses.${name}`) ?? "";
  const rigid = two && !joint;
  const wheels = (x) => [svg("circle", { class: "body", cx: x, cy: 219, r: 8 }), svg("circle", { class: "body", cx: x + 46, cy: 219, r: 8 })];
  const turned = (x) => [disc(x), line(`M ${x - 20} 196 A 33 33 0 0 0 ${x + 20} 196`), head(x + 20, 196, -42), line(`M ${x - 24} 228 L ${x - 9} 212 M ${x + 24} 228 L ${x + 9} 212`)];
  const at = (name, size) => rotary ? [...turned(344), text(344, 166, name), text(344, 184, size, "small")] : [...(two ? [] : wheels(338)), box(300, 132, 124, 74), text(362, 166, name), text(362, 184, size, "small")];
  const shapes = {
    motion: [hit(8, 12, 94, 56), box(14, 22, 82, 36), line("M 26 50 H 36 L 48 32 H 62 L 74 50 H 84", "thin"), line("M 96 40 H 124"), head(124, 40, 0)],
    controller: [hit(118, 12, 142, 56), svg("circle", { class: "body", cx: 132, cy: 40, r: 8 }), line("M 140 40 H 158"), box(158, 22, 96, 36), text(206, 44, "Controller")],
    actuator: [hit(268, 12, 112, 110), line("M 254 40 H 280"), head(280, 40, 0), box(280, 22, 88, 36), text(324, 44, "Actuator"), line("M 350 58 V 128"), head(350, 128, 90)],
    encoder: [hit(388, 12, 84, 180), box(436, 138, 26, 46), line("M 441 148 H 457 M 441 156 H 457 M 441 164 H 457 M 441 172 H 457", "thin"), line("M 449 138 V 80 H 132 V 50"), head(132, 50, -90), text(424, 74, "encoder", "small")],
    stage: [hit(294, 124, 136, 90), ...at("Stage", mass("stage"))],
    friction: [hit(12, 206, 456, 50), line("M 20 228 H 460"), line(Array.from({ length: 44 }, (_, k) => `M ${24 + 10 * k} 228 l -7 9`).join(" "), "thin"), text(240, 252, `Bearing: ${value("friction.model") ?? "no friction"}`, "small")],
  };
  if (two && rotary) {
    shapes.cart = [hit(86, 122, 100, 106), ...turned(136), text(136, 166, "Cart"), text(136, 184, mass("cart"), "small")];
  } else if (two) {
    shapes.cart = [hit(58, 146, 130, 82), ...wheels(99), box(66, 154, 114, 58), text(123, 182, "Cart"), text(123, 199, mass("cart"), "small")];
  } else if (value("masses.stage") == null) {
    shapes.cart = [hit(294, 124, 136, 90), ...at("Cart", mass("cart"))];
    delete shapes.stage;
  }
  if (rigid) shapes.cart.push(line("M 180 183 H 300"), line("M 180 179 H 300", "thin"), text(240, 172, "rigid", "small"));
  if (rotary) shapes.encoder.push(line("M 387 161 H 436", "thin"));
  if (joint) {
    shapes.joint = [
      hit(184, 146, 112, 66),
      line("M 180 168 H 202 l 5 -8 l 10 16 l 10 -16 l 10 16 l 10 -16 l 10 16 l 5 -8 H 300"),
      line(`M ${rotary ? 171 : 180} 196 H 232 M 232 187 V 205 M 248 187 V 205 M 248 196 H 312`),
    ];
    if (value("flexure.thickness") != null) {
      shapes.leaves = [hit(186, 206, 108, 18), line("M 200 210 V 222 M 280 210 V 222", "thin"), text(240, 221, "leaf springs", "small")];
    }
  }
  return shapes;
}

/** Parts that stand further left where a motor drives the stage from the right. */
const BESIDE_MOTOR = ["stage", "cart", "joint", "leaves"];

/** A motor that drives the stage through a screw, a gear or another spring, and encoders on the sides that the file names. */
function transmission(shapes, value) {
  const [lead, ratio] = [value("transmission.lead"), value("transmission.ratio")];
  const thread = Array.from({ length: 5 }, (_, k) => `M ${372 + 7 * k} 176 l 5 -12`).join(" ");
  const spring = line("M 368 170 H 374 l 4 -7 l 7 14 l 7 -14 l 7 14 l 4 -7 H 408");
  const gear = [line("M 368 170 H 376 M 404 170 H 408"), svg("circle", { class: "body", cx: 385, cy: 170, r: 9 }), svg("circle", { class: "body", cx: 399, cy: 170, r: 5 })];
  const link = lead ? [line(`M 368 164 H 408 M 368 176 H 408 ${thread}`)] : ratio ? gear : [spring];
  const name = lead ? `screw, ${lead}` : ratio ? `gear, ${ratio}` : "transmission";
  shapes.actuator = [hit(268, 12, 112, 56), hit(370, 140, 106, 66), line("M 254 40 H 280"), head(280, 40, 0), box(280, 22, 88, 36), text(324, 44, "Drive"), line("M 368 40 H 428 V 150"), head(428, 150, 90), ...link, box(408, 150, 62, 40), text(439, 174, "Motor"), text(434, 203, name, "small")];
  const starts = { motor: "M 452 150", load: "M 312 125" };
  const [position, velocity] = [value("encoder.position"), value("encoder.velocity")];
  const sides = [...new Set([position, velocity])];
  const ends = [line(`${starts[position]} V 80 H 132 V 50`), head(132, 50, -90)];
  if (position !== velocity) ends.push(line(`${starts[velocity]} V 92 H 206 V 60`), head(206, 60, -90), text(234, 104, "velocity", "small"));
  const bodies = sides.map((side) => box(side === "motor" ? 444 : 292, side === "motor" ? 143 : 125, side === "motor" ? 16 : 40, 7));
  shapes.encoder = [hit(388, 72, 84, 70), ...ends, ...bodies, text(164, 76, position === velocity ? "encoder" : "position", "small")];
}

function lockSwitch(locked, lock, transform) {
  const turn = () => lock(!locked);
  const group = svg("g", {
    class: "part",
    tabindex: 0,
    role: "switch",
    "aria-checked": String(locked),
    "aria-label": "Joint locked",
    id: "part-lock",
    "data-part": "lock",
    transform,
    onclick: turn,
    onkeydown: (event) => {
      if (event.key !== "Enter" && event.key !== " ") return;
      event.preventDefault();
      turn();
    },
  });
  group.append(svg("rect", { class: "hit", x: 190, y: 98, width: 100, height: 34, rx: 5 }));
  group.append(svg("rect", { class: "body", x: 198, y: 106, width: 32, height: 18, rx: 9 }));
  group.append(svg("circle", { cx: locked ? 221 : 207, cy: 115, r: 6, fill: "currentColor" }));
  group.append(text(262, 119, locked ? "locked" : "free"));
  if (locked) group.append(line("M 240 132 V 150"), line("M 176 150 H 304"));
  return group;
}
