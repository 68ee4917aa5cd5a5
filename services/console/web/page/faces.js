// Finds faces in pictures that follow one another, as services/perception/eyes/sources/litert.py does, by the same models: a detector, and the mesh of each face.
// Both must find the same: what is changed here is changed there.
const DETECTED = 128; // pixels of the side of a picture that the detector takes
const MESHED = 192;
const EVERY = 5; // pictures after which the detector looks for who has come
const SURE = 0.5; // confidence from which on there is a face
const REFINED = 4; // squares that are tried for a new face, each by the points that were found in the one before
const SAME = 0.3; // share of two boxes that they have in common, from which on they are one face
const LARGER = 1.5; // side of the square around a face, by that of its points
const POINTS = 468;
const [LEFT_EYE, RIGHT_EYE] = [263, 33]; // outer corners of the eyes, of the person
const ANCHORS = [[16, 2], [8, 6]].flatMap(([n, k]) => Array.from({ length: n * n * k }, (_, index) => {
  const cell = Math.floor(index / k);
  return [((cell % n) + 0.5) / n, (Math.floor(cell / n) + 0.5) / n];
}));
const chance = (logarithm) => 1 / (1 + Math.exp(-logarithm));

// detect, mesh: models, as functions from a picture (numbers, by rows, three colors each) to their outputs. most: faces at once.
export function finder(detect, mesh, most) {
  let known = [];
  let count = 0;

  // picture: width, height and data (four bytes a pixel). Returns the points of each face (x, y, depth in pixels), and the confidence that it is one.
  function find(picture) {
    const before = known;
    const found = [];
    known = [];
    for (const crop of before) take(picture, crop, found);
    if (found.length < most && (count % EVERY === 0 || !found.length)) {
      for (const crop of sought(picture, !found.length)) take(picture, crop, found);
    }
    count += 1;
    return found;
  }

  // Adds the face in a square, if there is one that is not among those that were found, and room for it.
  function take(picture, crop, found) {
    if (found.length === most || known.some((old) => isSame(crop, old))) return;
    const face = meshed(picture, crop);
    const there = around(face.points);
    if (face.confidence < SURE || known.some((old) => isSame(there, old))) return;
    known.push(there);
    found.push(face);
  }

  // The square of a new face: the mean of those that are sure, by how sure they are; null: none is. Each but the first is by the points that were found in the one before.
  // All are sure to the last digit, so to take the surest would be chance, and another one than in litert.py.
  function refined(picture, crop) {
    for (const first of [crop, { ...crop, angle: 0 }]) {
      const tried = [];
      for (let each = first, n = 0; n < REFINED; n += 1) {
        const { points, confidence } = meshed(picture, each);
        tried.push([each, Math.max(confidence - SURE, 0)]);
        each = around(points);
      }
      if (tried.some(([, weight]) => weight)) return between(tried);
    }
    return null;
  }

  // In the whole picture, and now and then in parts of it, in which who is far is larger: all of them, if nobody is known or near.
  function sought(picture, isAlone) {
    const surest = (crops) => crops.map((crop) => refined(picture, crop)).filter(Boolean);
    const found = surest(detected(picture, { left: 0, top: 0, width: picture.width, height: picture.height }));
    if (count % EVERY !== 0) return found;
    let looked = parts(picture);
    if (found.length || !isAlone) looked = [looked[Math.floor(count / EVERY) % looked.length]];
    return [...found, ...looked.flatMap((part) => surest(detected(picture, part)))];
  }

  // Squares in a part of a picture in which faces may be, the surest first.
  function detected(picture, part) {
    const side = Math.max(part.width, part.height);
    const wide = Math.max(1, Math.floor((DETECTED * part.width) / side));
    const tall = Math.max(1, Math.floor((DETECTED * part.height) / side));
    const across = Math.floor((DETECTED - wide) / 2);
    const down = Math.floor((DETECTED - tall) / 2);
    const small = new Float32Array(DETECTED * DETECTED * 3).fill(-1);
    const colors = shrunk(picture, part, wide, tall);
    for (let y = 0; y < tall; y += 1) {
      for (let at = 0; at < wide * 3; at += 1) small[((down + y) * DETECTED + across) * 3 + at] = colors[y * wide * 3 + at] / 127.5 - 1;
    }
    const [boxes, scores] = detect(small).sort((one, other) => other.length - one.length);
    let sure = ANCHORS.map((_, index) => index).filter((index) => scores[index] > 0); // a logarithm of chances: 0 is one half
    sure.sort((one, other) => scores[other] - scores[one]);
    const value = (index, place, axis) => boxes[index * 16 + 2 * place + axis] / DETECTED;
    const middle = (index, axis) => value(index, 0, axis) + ANCHORS[index][axis];
    const found = [];
    while (sure.length) {
      const [best] = sure;
      const reach = Math.max(value(best, 1, 0), value(best, 1, 1)) / 2;
      const isNear = (index) => Math.max(...[0, 1].map((axis) => Math.abs(middle(index, axis) - middle(best, axis)))) < reach;
      const near = sure.filter(isNear);
      const weights = near.map((index) => chance(scores[index]));
      const total = weights.reduce((sum, each) => sum + each, 0);
      const mean = (each) => near.reduce((sum, index, n) => sum + weights[n] * each(index), 0) / total;
      const [right, left] = [2, 3].map((eye) => [0, 1].map((axis) => mean((index) => value(index, eye, axis) + ANCHORS[index][axis])));
      const size = Math.max(mean((index) => value(index, 1, 0)), mean((index) => value(index, 1, 1)));
      found.push({
        x: mean((index) => middle(index, 0)) * side - (across * side) / DETECTED + part.left,
        y: mean((index) => middle(index, 1)) * side - (down * side) / DETECTED + part.top,
        side: size * side * LARGER, angle: Math.atan2(left[1] - right[1], left[0] - right[0]),
      });
      sure = sure.filter((index) => !isNear(index));
    }
    return found;
  }

  const patch = new Float32Array(MESHED * MESHED * 3);
  function meshed(picture, crop) {
    const scale = crop.side / MESHED;
    const [c, s] = [Math.cos(crop.angle), Math.sin(crop.angle)];
    const place = (x, y) => [crop.x + (c * x - s * y) * scale, crop.y + (s * x + c * y) * scale]; // x, y: from the middle of the square
    const [across, down] = [c * scale, s * scale]; // from one column to the next
    for (let row = 0; row < MESHED; row += 1) {
      const [left, top] = place(0.5 - MESHED / 2, row + 0.5 - MESHED / 2);
      for (let column = 0; column < MESHED; column += 1) {
        blend(picture, left - 0.5 + column * across, top - 0.5 + column * down, patch, (row * MESHED + column) * 3);
      }
    }
    const [values, score] = mesh(patch).sort((one, other) => other.length - one.length);
    const points = new Float32Array(POINTS * 3);
    for (let at = 0; at < points.length; at += 3) {
      [points[at], points[at + 1]] = place(values[at] - MESHED / 2, values[at + 1] - MESHED / 2);
      points[at + 2] = values[at + 2] * scale;
    }
    return { points, confidence: chance(score[0]) };
  }
  return { find };
}

// Color between four pixels, 0..1; beyond the edge it is that of the edge. It is called for each pixel, and so makes nothing.
function blend({ width, height, data }, x, y, out, at) {
  const left = Math.floor(x);
  const top = Math.floor(y);
  const right = x - left;
  const low = y - top;
  const l = Math.min(Math.max(left, 0), width - 1) * 4;
  const r = Math.min(Math.max(left + 1, 0), width - 1) * 4;
  const t = Math.min(Math.max(top, 0), height - 1) * width * 4;
  const b = Math.min(Math.max(top + 1, 0), height - 1) * width * 4;
  for (let color = 0; color < 3; color += 1) {
    const above = data[t + l + color] * (1 - right) + data[t + r + color] * right;
    const below = data[b + l + color] * (1 - right) + data[b + r + color] * right;
    out[at + color] = Math.round(above * (1 - low) + below * low) / 255;
  }
}

// A part of a picture, made smaller: each pixel is the mean of what it covers. Returns its colors, by rows.
function shrunk({ width, data }, part, wide, tall) {
  const [columns, rows] = [covered(part.width, wide), covered(part.height, tall)];
  const small = new Float32Array(wide * tall * 3);
  for (let y = 0; y < tall; y += 1) {
    const high = rows[y];
    for (let x = 0; x < wide; x += 1) {
      const broad = columns[x];
      let red = 0;
      let green = 0;
      let blue = 0;
      for (let j = 0; j < high.shares.length; j += 1) {
        const begin = ((part.top + high.from + j) * width + part.left + broad.from) * 4;
        for (let i = 0; i < broad.shares.length; i += 1) {
          const weight = high.shares[j] * broad.shares[i];
          red += data[begin + 4 * i] * weight;
          green += data[begin + 4 * i + 1] * weight;
          blue += data[begin + 4 * i + 2] * weight;
        }
      }
      const at = (y * wide + x) * 3;
      small[at] = Math.round(red);
      small[at + 1] = Math.round(green);
      small[at + 2] = Math.round(blue);
    }
  }
  return small;
}
// Which of many pixels in a row each of few covers: the first, and the share that it has of each from there on.
function covered(many, few) {
  const step = many / few;
  return Array.from({ length: few }, (_, index) => {
    const [begin, end] = [index * step, (index + 1) * step];
    const from = Math.floor(begin);
    const until = Math.min(many, Math.ceil(end - 1e-9));
    return { from, shares: Array.from({ length: until - from }, (_, k) => (Math.min(end, from + k + 1) - Math.max(begin, from + k)) / step) };
  });
}

// The square around the points of a face.
function around(points) {
  const at = (index, axis) => points[3 * index + axis];
  const angle = Math.atan2(at(LEFT_EYE, 1) - at(RIGHT_EYE, 1), at(LEFT_EYE, 0) - at(RIGHT_EYE, 0));
  const [c, s] = [Math.cos(angle), Math.sin(angle)];
  const [low, high] = [[Infinity, Infinity], [-Infinity, -Infinity]];
  for (let index = 0; index < POINTS; index += 1) {
    const turned = [c * at(index, 0) + s * at(index, 1), c * at(index, 1) - s * at(index, 0)];
    for (const axis of [0, 1]) {
      low[axis] = Math.min(low[axis], turned[axis]);
      high[axis] = Math.max(high[axis], turned[axis]);
    }
  }
  const [x, y] = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
  return { x: c * x - s * y, y: s * x + c * y, side: Math.max(high[0] - low[0], high[1] - low[1]) * LARGER, angle };
}

// A square between several, by their weights.
function between(crops) {
  const total = crops.reduce((sum, [, weight]) => sum + weight, 0);
  const mean = (part) => crops.reduce((sum, [crop, weight]) => sum + weight * part(crop), 0) / total;
  const [x, y, side] = ["x", "y", "side"].map((part) => mean((crop) => crop[part]));
  return { x, y, side, angle: Math.atan2(mean(({ angle }) => Math.sin(angle)), mean(({ angle }) => Math.cos(angle))) };
}

// Squares that cover a picture, each with a half of the next.
function parts({ width, height }) {
  const side = Math.floor((Math.min(width, height) * 2) / 3);
  const step = Math.floor(side / 2);
  const found = [];
  for (let top = 0; top <= height - side; top += step) {
    for (let left = 0; left <= width - side; left += step) found.push({ left, top, width: side, height: side });
  }
  return found;
}

// Whether two squares hold one face. What they have in common is taken as if both stood upright.
function isSame(one, other) {
  const common = ["x", "y"].reduce((area, axis) => {
    const low = Math.max(one[axis] - one.side / 2, other[axis] - other.side / 2);
    const high = Math.min(one[axis] + one.side / 2, other[axis] + other.side / 2);
    return area * Math.max(high - low, 0);
  }, 1);
  return common > SAME * (one.side ** 2 + other.side ** 2 - common);
}
