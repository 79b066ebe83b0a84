/** Packing and unpacking of bytes that the page sends and receives. */

const KINDS = { float32: Float32Array, uint32: Uint32Array, uint8: Uint8Array };

/** Facts, and arrays by name, of an ArrayBuffer that `pack_message` in drafts.py made. */
export function unpacked(buffer) {
  const long = new DataView(buffer).getUint32(0, true);
  const facts = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, long)));
  const arrays = {};
  for (const [name, { type, shape, at }] of Object.entries(facts.arrays)) {
    arrays[name] = new KINDS[type](buffer, 4 + long + at, shape.reduce((a, b) => a * b, 1));
  }
  return { facts, arrays };
}

/** Download a file with this name, and bytes or text. */
export function download(name, content, type = 'application/octet-stream') {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(new Blob([content], { type }));
  link.download = name;
  link.click();
  URL.revokeObjectURL(link.href);
}

/** A file as base64. */
export async function base64(file) {
  const bytes = new Uint8Array(await file.arrayBuffer());
  let text = '';
  for (let i = 0; i < bytes.length; i += 32768) text += String.fromCharCode(...bytes.subarray(i, i + 32768));
  return btoa(text);
}
