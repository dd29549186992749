'use strict';
(() => {
  const root = document.documentElement;
  const errors = [];
  addEventListener('error', (e) => { errors.push(e.message); root.dataset.errors = errors.join('; '); });
  const all = (selector, within = document) => Array.from(within.querySelectorAll(selector));
  const timers = new Map();

  function mix(lay, percent) {
    lay.style.setProperty('--mix', String(percent / 100));
  }

  // Half a second of each picture; the slider stays where it was and has the last word.
  function blink(button, on) {
    const lay = button.closest('.lay');
    button.setAttribute('aria-pressed', String(on));
    clearInterval(timers.get(button));
    timers.delete(button);
    if (on) {
      let second = false;
      const swap = () => { second = !second; mix(lay, second ? 100 : 0); };
      swap();
      timers.set(button, setInterval(swap, 500));
    } else {
      mix(lay, Number(lay.querySelector('[data-mix]').value));
    }
  }

  for (const slider of all('[data-mix]')) {
    slider.addEventListener('input', () => {
      const lay = slider.closest('.lay');
      for (const button of all('[data-blink][aria-pressed=true]', lay)) blink(button, false);
      mix(lay, Number(slider.value));
    });
  }
  for (const button of all('[data-blink]')) {
    button.addEventListener('click', () => blink(button, button.getAttribute('aria-pressed') !== 'true'));
  }
  // Where the clipboard is closed to pages from files, the text is selected to be copied by hand.
  for (const button of all('[data-copy]')) {
    button.addEventListener('click', () => {
      const pre = button.parentElement.querySelector('pre');
      const chosen = () => {
        const range = document.createRange();
        range.selectNodeContents(pre);
        const selection = getSelection();
        selection.removeAllRanges();
        selection.addRange(range);
      };
      const said = (word) => { button.textContent = word; setTimeout(() => { button.textContent = 'Copy'; }, 1500); };
      chosen();
      if (navigator.clipboard) {
        navigator.clipboard.writeText(pre.textContent).then(() => said('Copied'), () => said('Selected'));
      } else {
        said('Selected');
      }
    });
  }
  for (const box of all('[data-difference]')) {
    box.addEventListener('change', () => box.closest('.lay').classList.toggle('difference', box.checked));
  }
  for (const box of all('input[data-layer]')) {
    box.addEventListener('change', () => document.body.classList.toggle('hide-' + box.dataset.layer, !box.checked));
  }

  // `#selftest`: moves every control and says in the root element what came of it (docs/report.md).
  function selftest() {
    const said = [];
    const check = (name, ok) => said.push(name + (ok ? ':ok' : ':failed'));
    const opacity = (lay) => Number(getComputedStyle(lay.querySelector('.over')).opacity);
    JSON.parse(document.getElementById('groundcal-data').textContent);
    for (const lay of all('.lay')) {
      const slider = lay.querySelector('[data-mix]');
      if (!slider) continue;
      for (const value of ['0', '30', '100', '50']) {
        slider.value = value;
        slider.dispatchEvent(new Event('input'));
        check('slider', Math.abs(opacity(lay) - Number(value) / 100) < 0.01);
      }
      const button = lay.querySelector('[data-blink]');
      button.click();
      check('blink', opacity(lay) === 1);
      button.click();
      check('still', Math.abs(opacity(lay) - 0.5) < 0.01);
      const box = lay.querySelector('[data-difference]');
      box.click();
      check('difference', getComputedStyle(lay.querySelector('.over')).mixBlendMode === 'difference');
      box.click();
    }
    for (const box of all('input[data-layer]')) {
      const layer = document.querySelector('g[data-layer=' + box.dataset.layer + ']');
      box.click();
      check('layer', !layer || getComputedStyle(layer).display === 'none');
      box.click();
    }
    for (const button of all('[data-copy]')) {
      button.closest('details').open = true;
      button.click();
      check('copy', getSelection().toString().trim() === button.parentElement.querySelector('pre').textContent.trim());
    }
    const pictures = all('image').filter((i) => i.getAttribute('href').startsWith('data:image/jpeg;base64,'));
    check('pictures', pictures.length === all('image').length);
    root.dataset.selftest = said.join(' ');
  }
  if (location.hash === '#selftest') selftest();
})();
