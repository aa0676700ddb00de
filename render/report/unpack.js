// Unpacks the data that sim/report/page_data.cpp packs.
const MISSING = -2147483648;
async function inflated(text) {                   // -> the bytes of a zlib stream in base64
  const binary = atob(text), packed = new Uint8Array(binary.length);
  for (let k = 0; k < binary.length; k++) packed[k] = binary.charCodeAt(k);
  return new Uint8Array(await new Response(new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer());
}
function unpackNumbers(bytes, about, reference) { // -> numbers, column by column; MISSING for missing values
  const n = about.n, size = n * about.components, numbers = new Int32Array(size);
  for (let column = 0; column < size; column += n)
    for (let row = 0, difference = 0; row < n; row++) {
      const k = column + row, code = bytes[k] | bytes[k + size] << 8 | bytes[k + 2 * size] << 16 | bytes[k + 3 * size] << 24;
      if (code === -1) { numbers[k] = MISSING; continue; }
      difference = difference + (code >>> 1 ^ -(code & 1)) | 0;
      numbers[k] = difference + (reference && reference[row] !== MISSING ? reference[row] : 0);
    }
  return numbers;
}
