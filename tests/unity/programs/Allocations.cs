using System;
using System.Collections.Generic;
using System.Reflection;
using System.Reflection.Emit;
using UnityEngine;

/// <summary>Walks the package's compiled code from what Unity calls each frame and tells where it makes an object.</summary>
public static class Allocations
{
    const BindingFlags All = BindingFlags.Instance | BindingFlags.Static | BindingFlags.Public | BindingFlags.NonPublic | BindingFlags.DeclaredOnly;
    static readonly Dictionary<int, OpCode> Codes = new Dictionary<int, OpCode>();

    /// <summary>once: TYPE.METHOD not walked into. Prints a line for each: `frame`, `once` that was met, `makes`.</summary>
    public static void Print(Assembly package, string[] once)
    {
        foreach (FieldInfo field in typeof(OpCodes).GetFields(BindingFlags.Static | BindingFlags.Public))
        {
            var code = (OpCode)field.GetValue(null);
            Codes[(ushort)code.Value] = code;
        }
        var waiting = new Queue<MethodBase>();
        var seen = new HashSet<MethodBase>();
        waiting.Enqueue(typeof(Gsac.GsacCameras).GetMethod("Draw", All, null, new[] { typeof(Camera) }, null));
        Console.WriteLine("frame GsacCameras.Draw");
        foreach (Type type in package.GetTypes())
        {
            if (!typeof(MonoBehaviour).IsAssignableFrom(type)) continue;
            foreach (string message in new[] { "Update", "LateUpdate", "Listen" })
            {
                MethodInfo method = type.GetMethod(message, All, null, Type.EmptyTypes, null);
                if (method == null) continue;
                Console.WriteLine("frame " + type.Name + "." + message);
                waiting.Enqueue(method);
            }
        }
        while (waiting.Count > 0)
        {
            MethodBase method = waiting.Dequeue();
            if (!seen.Add(method)) continue;
            string name = method.DeclaringType.Name + "." + method.Name;
            if (Array.IndexOf(once, name) >= 0)
            {
                Console.WriteLine("once " + name);
                continue;
            }
            foreach (KeyValuePair<OpCode, MemberInfo> step in Steps(method))
            {
                var called = step.Value as MethodBase;
                if (called != null && called.DeclaringType.Assembly == package) waiting.Enqueue(called);
                string made = Made(step.Key, step.Value);
                if (made != null) Console.WriteLine("makes " + name + " " + made);
            }
        }
        Console.WriteLine("walked " + seen.Count);
    }

    /// <summary>What an instruction puts on the heap, null for nothing. An error's object does not count.</summary>
    static string Made(OpCode code, MemberInfo of)
    {
        if (code == OpCodes.Newarr) return of.Name + "[]";
        if (code == OpCodes.Box) return "box " + of.Name;
        if (code == OpCodes.Newobj)
        {
            Type type = of.DeclaringType;
            return type.IsValueType || typeof(Exception).IsAssignableFrom(type) ? null : "new " + type.Name;
        }
        var method = of as MethodInfo;
        if (method == null || method.DeclaringType.Assembly == typeof(Allocations).Assembly) return null;
        // what a collection or an error holds was made before
        bool foreign = method.DeclaringType.Namespace != "Gsac" && !method.DeclaringType.IsGenericType && method.DeclaringType != typeof(Exception);
        bool makes = method.ReturnType == typeof(string) || method.ReturnType.IsArray || method.Name == "GetEnumerator" && !method.ReturnType.IsValueType;
        return foreign && makes ? method.DeclaringType.Name + "." + method.Name : null;
    }

    /// <summary>The instructions of a method that name a member, in order.</summary>
    static IEnumerable<KeyValuePair<OpCode, MemberInfo>> Steps(MethodBase method)
    {
        MethodBody body = method.GetMethodBody();
        if (body == null) yield break;
        byte[] il = body.GetILAsByteArray();
        Type[] ofType = method.DeclaringType.IsGenericType ? method.DeclaringType.GetGenericArguments() : null;
        Type[] ofMethod = method.IsGenericMethod ? method.GetGenericArguments() : null;
        int at = 0;
        while (at < il.Length)
        {
            int value = il[at++];
            if (value == 0xfe) value = value << 8 | il[at++];
            OpCode code = Codes[value];
            switch (code.OperandType)
            {
                case OperandType.InlineMethod: case OperandType.InlineType: case OperandType.InlineTok: case OperandType.InlineField:
                    MemberInfo member = method.Module.ResolveMember(BitConverter.ToInt32(il, at), ofType, ofMethod);
                    at += 4;
                    yield return new KeyValuePair<OpCode, MemberInfo>(code, member);
                    break;
                case OperandType.InlineNone: break;
                case OperandType.ShortInlineBrTarget: case OperandType.ShortInlineI: case OperandType.ShortInlineVar: at += 1; break;
                case OperandType.InlineVar: at += 2; break;
                case OperandType.InlineI8: case OperandType.InlineR: at += 8; break;
                case OperandType.InlineSwitch: at += 4 + 4 * BitConverter.ToInt32(il, at); break;
                default: at += 4; break;
            }
        }
    }
}
