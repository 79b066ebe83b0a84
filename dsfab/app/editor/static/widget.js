/** Opens the page in a notebook: anywidget calls `render`. A frame isolates keys and style of the page. */

const PACKED = '{packed}'; // page.py puts index.html, style.css and all modules here

let made; // shared by all views

async function unpacked() {
  const bytes = Uint8Array.from(atob(PACKED), (letter) => letter.charCodeAt(0));
  const text = new Blob([bytes]).stream().pipeThrough(new DecompressionStream('gzip'));
  const { html, css, modules } = await new Response(text).json();
  const imports = {};
  for (const [name, text] of Object.entries(modules)) {
    imports[name] = URL.createObjectURL(new Blob([text], { type: 'text/javascript' }));
  }
  imports.three = imports['dsfab/vendor/three.module.js'];
  const page = new DOMParser().parseFromString(html, 'text/html');
  const style = page.createElement('style');
  style.textContent = css;
  page.querySelector('link[rel="stylesheet"]').replaceWith(style);
  page.querySelectorAll('script, link[rel="modulepreload"]').forEach((part) => part.remove());
  const map = Object.assign(page.createElement('script'), { type: 'importmap', textContent: JSON.stringify({ imports }) });
  const main = Object.assign(page.createElement('script'), { type: 'module', src: imports['dsfab/main.js'] });
  page.head.append(map, main);
  return `<!doctype html>${page.documentElement.outerHTML}`;
}

function render({ model, el }) {
  const frame = document.createElement('iframe');
  frame.title = 'dsfab: a structure and its controls';
  frame.allow = 'clipboard-write; fullscreen';
  const tall = () => (frame.style.height = `${model.get('height')}px`);
  frame.style.cssText = 'display: block; width: 100%; border: 1px solid #8884; border-radius: 6px; color-scheme: normal;';
  tall();
  model.on('change:height', tall);
  frame.dsfab = { model };
  made ??= unpacked();
  made.then((html) => (frame.srcdoc = html));
  el.append(frame);
  return () => {
    model.off('change:height', tall);
    frame.remove();
  };
}

export default { render };
