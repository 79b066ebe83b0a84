/* What is wrong with the page that is open, for whoever reads it on a telephone, in the dark, or by ear: what Lighthouse
   would say of headings, pictures, width and contrast (WCAG 2.2, 1.4.3). A list of strings. */
(() => {
  const found = [], seen = node => { const s = getComputedStyle(node), b = node.getBoundingClientRect();
    return s.visibility !== 'hidden' && s.display !== 'none' && b.width > 1 && b.height > 1; };
  const rgb = text => (text.match(/[\d.]+/g) || [0, 0, 0, 0]).map(Number);
  const over = (top, under) => { const a = top.length > 3 ? top[3] : 1; return [0, 1, 2].map(i => a * top[i] + (1 - a) * under[i]); };
  const light = c => { const [r, g, b] = c.map(x => (x /= 255) <= .04045 ? x / 12.92 : ((x + .055) / 1.055) ** 2.4);
    return .2126 * r + .7152 * g + .0722 * b; };
  const ground = node => { const all = []; for (let n = node; n; n = n.parentElement) all.push(rgb(getComputedStyle(n).backgroundColor));
    return all.reverse().reduce((under, top) => over(top, under), [255, 255, 255]); };
  const article = document.querySelector('article');
  if (document.documentElement.scrollWidth > innerWidth + 1) found.push('wider than the window: ' + document.documentElement.scrollWidth);
  const levels = [...article.querySelectorAll('h1, h2, h3, h4, h5')].map(h => +h.tagName[1]);
  if (levels.filter(l => l === 1).length !== 1) found.push('not one h1');
  levels.forEach((l, i) => { if (i && l > levels[i - 1] + 1) found.push('a heading is skipped before ' + i); });
  article.querySelectorAll('img').forEach(i => { if (!i.alt || !i.naturalWidth) found.push('picture ' + i.src); });
  const walker = document.createTreeWalker(article, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) { const node = walker.currentNode.parentElement;
    if (!walker.currentNode.data.trim() || !seen(node) || node.closest('.headerlink, svg, .md-clipboard')) continue;
    const back = ground(node), a = light(over(rgb(getComputedStyle(node).color), back)), b = light(back);
    const size = parseFloat(getComputedStyle(node).fontSize), ratio = (Math.max(a, b) + .05) / (Math.min(a, b) + .05);
    if (ratio < (size >= 24 ? 3 : 4.5)) found.push(ratio.toFixed(2) + ' ' + node.tagName + '.' + node.className + ' ' + walker.currentNode.data.trim().slice(0, 30)); }
  return [...new Set(found)];
})()
