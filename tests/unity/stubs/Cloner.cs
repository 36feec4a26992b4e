// Not Unity's type: does what Object.Instantiate does, for objects with what the package's prefabs have.
using System;
using System.Collections.Generic;
using System.Reflection;

namespace UnityEngine
{
    static class Cloner
    {
        const BindingFlags Fields = BindingFlags.Instance | BindingFlags.NonPublic | BindingFlags.Public;

        public static T Clone<T>(T original) where T : Component
        {
            var pairs = new Dictionary<Component, Component>();
            GameObject copy = Copy(original.gameObject, pairs);
            foreach (KeyValuePair<Component, Component> pair in pairs) Fill(pair.Key, pair.Value, pairs);
            foreach (Component made in pairs.Values) Player.Call(made, "OnEnable");
            copy.name = original.name + "(Clone)";
            return (T)pairs[original];
        }

        static GameObject Copy(GameObject from, Dictionary<Component, Component> pairs)
        {
            var to = new GameObject(from.name) { layer = from.layer };
            foreach (Component c in from.Components)
            {
                if (c is Transform)
                {
                    pairs[c] = to.transform;
                    to.transform.localPosition = from.transform.localPosition;
                    to.transform.localRotation = from.transform.localRotation;
                    to.transform.localScale = from.transform.localScale;
                    continue;
                }
                var made = (Component)Activator.CreateInstance(c.GetType());
                made.gameObject = to;
                made.name = to.name;
                to.Components.Add(made);
                pairs[c] = made;
            }
            foreach (Transform child in from.transform.Children) Copy(child.gameObject, pairs).transform.SetParent(to.transform, false);
            return to;
        }

        static void Fill(Component from, Component to, Dictionary<Component, Component> pairs)
        {
            if (from is Transform) return;
            bool ours = from is MonoBehaviour;
            foreach (FieldInfo field in from.GetType().GetFields(Fields))
            {
                if (field.DeclaringType == typeof(Component) || field.DeclaringType == typeof(Object)) continue;
                if (!ours || field.IsPublic && !field.IsInitOnly || field.IsDefined(typeof(SerializeField), true)) field.SetValue(to, Copied(field.GetValue(from), pairs));
            }
        }

        static object Copied(object value, Dictionary<Component, Component> pairs)
        {
            Component found;
            var one = value as Component;
            if (!ReferenceEquals(one, null)) return pairs.TryGetValue(one, out found) ? found : one;
            var many = value as Transform[];
            return many == null ? value : Array.ConvertAll(many, t => pairs.TryGetValue(t, out found) ? (Transform)found : t);
        }
    }
}
